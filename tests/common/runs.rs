//! Runs of the recipe of a desk, `recipe.toml`.

use serde_json::Value;

use crate::desk::Desk;

/// Twelve triangles.
pub(crate) const CUBE: &str = include_str!("cube.obj");

impl Desk {
    /// Runs the recipe, without pictures.
    pub(crate) fn run(&self, arguments: &[&str]) -> assert_cmd::assert::Assert {
        self.meshmill(&["run", "recipe.toml", "--pictures", "none"]).args(arguments).assert()
    }

    /// What `--json` says of a run that ends with this code.
    pub(crate) fn report(&self, code: i32, arguments: &[&str]) -> Value {
        let assert = self.run(&[&["--json"], arguments].concat()).code(code);
        serde_json::from_slice(&assert.get_output().stdout).unwrap()
    }
}
