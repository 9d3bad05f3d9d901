//! Which samples are learnt from, and which are not.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Places of samples, each in one part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// To learn from.
    pub learn: Vec<usize>,
    /// To be measured on.
    pub test: Vec<usize>,
}

/// A `share` of all samples to learn from, drawn from `seed`; the others to be measured on. The parts of a smaller share are
/// within those of a larger one.
pub fn random_split(samples: usize, share: f64, seed: u64) -> Split {
    let mut order: Vec<usize> = (0..samples).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let test = order.split_off(((samples as f64 * share).round() as usize).min(samples));
    Split { learn: order, test }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_whole_and_grow() {
        let (small, large) = (random_split(100, 0.1, 7), random_split(100, 0.3, 7));
        assert_eq!((small.learn.len(), large.learn.len(), large.test.len()), (10, 30, 70));
        assert_eq!(small.learn, large.learn[..10]);
        let mut all = [large.learn.clone(), large.test.clone()].concat();
        all.sort_unstable();
        assert_eq!(all, (0..100).collect::<Vec<_>>());
        assert_ne!(large, random_split(100, 0.3, 8));
    }
}
