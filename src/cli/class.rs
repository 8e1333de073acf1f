//! How results are compared, as `lock` and `bundle` are told.

use clap::ValueEnum;

use super::exit::Fault;
use crate::report::lock::Class;

/// How results are compared.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ClassArguments {
    /// How results are compared: by bytes, by metrics, or by metrics within --tolerance.
    #[arg(long, value_name = "CLASS", default_value = "bytes")]
    class: ClassName,
    /// Largest relative difference of a metric, for the class `tolerance`.
    #[arg(long, value_name = "NUMBER", default_value_t = 1e-6)]
    tolerance: f64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ClassName {
    Bytes,
    Metrics,
    Tolerance,
}

impl ClassArguments {
    /// The class and the tolerance that a lock has.
    pub(super) fn read(&self) -> Result<(Class, f64), Fault> {
        if !(0.0..1.0).contains(&self.tolerance) {
            return Err(Fault::usage("--tolerance is a number from 0 to less than 1: 0.001 is one in a thousand"));
        }
        Ok(match self.class {
            ClassName::Bytes => (Class::Bytes, 0.0),
            ClassName::Metrics => (Class::Metrics, 0.0),
            ClassName::Tolerance => (Class::Tolerance, self.tolerance),
        })
    }
}
