//! Means and extremes of shape and size over a few faces: what an edit replaces, and what it makes.

/// Means and extremes of a set of faces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Number of faces.
    pub faces: usize,
    /// Sum of stretches.
    pub stretch_sum: f64,
    /// Least stretch.
    pub stretch_min: f64,
    /// Sum of sizes.
    pub size_sum: f64,
    /// Largest size.
    pub size_max: f64,
    /// Sum of inverse sizes.
    pub inverse_size_sum: f64,
    /// The stretch below which a face falls short.
    pub threshold: f64,
    /// Sum of what the faces lack to the threshold.
    pub shortfall: f64,
}

impl Tally {
    /// The empty set.
    pub fn new() -> Self {
        Self { stretch_min: f64::INFINITY, ..Self::default() }
    }

    /// The empty set, which will sum up what its faces lack to a stretch of `threshold`.
    pub fn short_of(threshold: f64) -> Self {
        Self { threshold, ..Self::new() }
    }

    /// Adds a face.
    #[inline]
    pub fn add(&mut self, stretch: f64, size: f64) {
        self.faces += 1;
        self.stretch_sum += stretch;
        self.stretch_min = self.stretch_min.min(stretch);
        self.size_sum += size;
        self.size_max = self.size_max.max(size);
        self.inverse_size_sum += if size > 0.0 { 1.0 / size } else { 0.0 };
        self.shortfall += (self.threshold - stretch).max(0.0);
    }

    /// Adds a face whose size nobody asks for.
    #[inline]
    pub fn add_stretch(&mut self, stretch: f64) {
        self.faces += 1;
        self.stretch_sum += stretch;
        self.stretch_min = self.stretch_min.min(stretch);
        self.shortfall += (self.threshold - stretch).max(0.0);
    }

    /// Mean stretch.
    pub fn mean(&self) -> f64 {
        if self.faces == 0 { 0.0 } else { self.stretch_sum / self.faces as f64 }
    }

    /// Whether these faces, which replace `before`, are a step towards the threshold: the least stretch rises, or the
    /// shortfall falls, each by more than rounding.
    pub fn mends(&self, before: &Self) -> bool {
        self.stretch_min > before.stretch_min * (1.0 + 1e-3)
            || self.shortfall < before.shortfall - 1e-4 * before.threshold
    }

    /// Equation 8: least times mean stretch.
    pub fn quality(&self) -> f64 {
        if self.faces == 0 { 0.0 } else { self.stretch_min * self.mean() }
    }
}
