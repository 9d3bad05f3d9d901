//! Hatching: in, two colours and how stripes run; out, the colour of a pixel.

use super::Rgb;

/// How the stripes of a hatching run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plot) enum Weave {
    /// No stripes.
    Plain,
    /// From the lower left to the upper right.
    Rising,
    /// From the upper left to the lower right.
    Falling,
    /// Both.
    Crossed,
    /// From left to right.
    Level,
    /// Upwards.
    Upright,
}

/// A hatching.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plot) struct Hatch {
    pub(in crate::plot) weave: Weave,
    /// Colour of the stripes, and of what is between them.
    pub(in crate::plot) stripe: Rgb,
    pub(in crate::plot) ground: Rgb,
    /// From stripe to stripe along a row or a column, and width of a stripe, pixels.
    pub(in crate::plot) period: i32,
    pub(in crate::plot) width: i32,
}

impl Hatch {
    /// Colour of a pixel.
    pub(in crate::plot) fn colour(&self, x: i32, y: i32) -> Rgb {
        let stripe = |along: i32| along.rem_euclid(self.period) < self.width;
        let on_stripe = match self.weave {
            Weave::Plain => false,
            Weave::Rising => stripe(x + y),
            Weave::Falling => stripe(x - y),
            Weave::Crossed => stripe(x + y) || stripe(x - y),
            Weave::Level => stripe(y),
            Weave::Upright => stripe(x),
        };
        if on_stripe { self.stripe } else { self.ground }
    }
}
