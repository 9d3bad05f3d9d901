//! How many sources the eigenvalues show.

use super::settings::Order;

/// The order by `order`, 0 to `eigenvalues.len() - 1`, for eigenvalues of falling size from `snapshots` independent
/// snapshots.
///
/// M. Wax and T. Kailath 1985, eqs. 14 and 17: `L = T (N - k) ln(arithmetic / geometric mean of the smallest N - k)`, plus
/// `k (2 N - k) ln(T) / 2` (MDL) or `k (2 N - k)` (AIC). With forward-backward averaging the eigenvectors are real but for a
/// fixed transform, and there are half as many free parameters: `k (2 N - k + 1) / 2` (G. Xu, R. H. Roy and T. Kailath 1994).
pub(super) fn select(order: Order, eigenvalues: &[f64], snapshots: f64, forward_backward: bool) -> usize {
    let n = eigenvalues.len();
    let weight = match order {
        Order::Fixed(order) => return order.min(n.saturating_sub(1)),
        Order::Mdl => snapshots.max(2.0).ln() / 2.0,
        Order::Aic => 1.0,
    };
    let (mut sum, mut logs) = (0.0, 0.0);
    let mut best = (f64::INFINITY, 0);
    for k in (0..n).rev() {
        let value = eigenvalues[k].max(f64::MIN_POSITIVE);
        sum += value;
        logs += value.ln();
        let left = (n - k) as f64;
        let fit = snapshots * (left * (sum / left).ln() - logs);
        let parameters = (k * (2 * n - k)) as f64;
        let free = if forward_backward { (parameters + k as f64) / 2.0 } else { parameters };
        let length = fit + weight * free;
        if length < best.0 {
            best = (length, k);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clear_cases_are_counted() {
        let eigenvalues = [40.0, 9.0, 1.1, 1.05, 1.0, 1.0, 0.95, 0.9];
        for order in [Order::Mdl, Order::Aic] {
            assert_eq!(select(order, &eigenvalues, 64.0, false), 2);
            assert_eq!(select(order, &eigenvalues, 64.0, true), 2);
            assert_eq!(select(order, &[1.0; 8], 64.0, true), 0);
            assert_eq!(select(order, &[0.0; 8], 64.0, false), 0);
            assert_eq!(select(order, &[f64::NAN; 8], 64.0, false), 0);
            assert_eq!(select(order, &[], 64.0, false), 0);
        }
        assert_eq!(select(Order::Fixed(9), &eigenvalues, 64.0, false), 7);
    }
}
