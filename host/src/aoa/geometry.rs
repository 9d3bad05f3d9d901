//! Where the antennas are, and what a wave from a direction does to them.

use num_complex::Complex64;
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::radar::{MAX_VIRTUAL, RadarProfile};

use super::settings::{SettingsError, Subarray};

/// A square matrix of at most [`MAX_VIRTUAL`] antennas; the rest is zero.
pub(super) type Matrix = [[Complex64; MAX_VIRTUAL]; MAX_VIRTUAL];

/// One number for each antenna; the rest is zero.
pub(super) type Vector = [Complex64; MAX_VIRTUAL];

/// Antennas of an array, in half wavelengths.
#[derive(Debug, Clone)]
pub(super) struct Geometry {
    pub(super) count: usize,
    /// To the right and upwards.
    pub(super) positions: [(i32, i32); MAX_VIRTUAL],
    /// By which the samples of an antenna must be multiplied.
    pub(super) signs: [f64; MAX_VIRTUAL],
    /// The antenna opposite to each about the centre, where every antenna has one.
    pub(super) opposite: Option<[usize; MAX_VIRTUAL]>,
}

impl Geometry {
    pub(super) fn of(profile: &RadarProfile) -> Result<Self, SettingsError> {
        let antennas = virtual_antennas(profile).ok_or(SettingsError::NoGeometry)?;
        let positions = antennas.iter().map(|a| (a.position.azimuth.into(), a.position.elevation.into()));
        let mut geometry = Self::at(positions);
        for (sign, antenna) in geometry.signs.iter_mut().zip(&antennas) {
            *sign = antenna.sign.into();
        }
        if geometry.span().0 == 0 {
            return Err(SettingsError::NoAzimuth);
        }
        Ok(geometry)
    }

    fn at(places: impl Iterator<Item = (i32, i32)>) -> Self {
        let mut positions = [(0, 0); MAX_VIRTUAL];
        let mut count = 0;
        for (position, place) in positions.iter_mut().zip(places) {
            *position = place;
            count += 1;
        }
        let opposite = opposite(&positions[..count]);
        Self { count, positions, signs: [1.0; MAX_VIRTUAL], opposite }
    }

    /// Largest differences of two positions, to the right and upwards.
    pub(super) fn span(&self) -> (usize, usize) {
        let span = |axis: fn(&(i32, i32)) -> i32| {
            let places = || self.positions[..self.count].iter().map(axis);
            places().max().zip(places().min()).map_or(0, |(max, min)| (max - min) as usize)
        };
        (span(|p| p.0), span(|p| p.1))
    }

    /// The steering vector of a direction with cosines `u` to the right and `w` upwards, signs left out: an antenna at
    /// (x, y) has the phase `-pi (x u + y w)`.
    pub(super) fn steering(&self, u: f64, w: f64) -> Vector {
        let mut steering = Vector::default();
        for (a, &(x, y)) in steering.iter_mut().zip(&self.positions).take(self.count) {
            let (sin, cos) = (-core::f64::consts::PI * (f64::from(x) * u + f64::from(y) * w)).sin_cos();
            *a = Complex64::new(cos, sin);
        }
        steering
    }

    /// The array of a rectangle of `subarray`, and the antennas that it covers at each of its places; `None` where the array
    /// does not fill it anywhere.
    pub(super) fn rectangles(&self, subarray: Subarray) -> Option<(Self, Vec<[usize; MAX_VIRTUAL]>)> {
        let (columns, rows) = (i32::from(subarray.columns), i32::from(subarray.rows));
        if columns < 1 || rows < 1 || columns.checked_mul(rows)? > MAX_VIRTUAL as i32 {
            return None;
        }
        let cells = || (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        let positions = &self.positions[..self.count];
        let mut places = Vec::new();
        let mut corners = positions.to_vec();
        corners.sort_unstable();
        corners.dedup();
        for (x0, y0) in corners {
            let mut antennas = [0; MAX_VIRTUAL];
            let filled = antennas.iter_mut().zip(cells()).all(|(antenna, (x, y))| {
                let found = positions.iter().position(|&p| p == (x0 + x, y0 + y));
                found.map(|found| *antenna = found).is_some()
            });
            if filled {
                places.push(antennas);
            }
        }
        (!places.is_empty()).then(|| (Self::at(cells()), places))
    }
}

fn opposite(positions: &[(i32, i32)]) -> Option<[usize; MAX_VIRTUAL]> {
    let (x0, y0) = (positions.iter().map(|p| p.0).min()?, positions.iter().map(|p| p.1).min()?);
    let (x1, y1) = (positions.iter().map(|p| p.0).max()?, positions.iter().map(|p| p.1).max()?);
    let mut opposite = [usize::MAX; MAX_VIRTUAL];
    for (i, &(x, y)) in positions.iter().enumerate() {
        if opposite[i] != usize::MAX {
            continue;
        }
        let mirrored = (x0 + x1 - x, y0 + y1 - y);
        let free = |&j: &usize| opposite[j] == usize::MAX && positions[j] == mirrored;
        // Two antennas may be in one place; only one in the centre is its own opposite.
        let j = (i + 1..positions.len()).find(free).or((mirrored == (x, y)).then_some(i))?;
        (opposite[i], opposite[j]) = (j, i);
    }
    Some(opposite)
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::array::AntennaArray;

    use super::*;

    fn geometry(array: AntennaArray) -> Geometry {
        let mut profile = RadarProfile { array, ..RadarProfile::bridge() };
        if array == AntennaArray::Xwr1642Boost {
            profile.tx_order = [1, 2].into_iter().collect();
        }
        Geometry::of(&profile).unwrap()
    }

    #[test]
    fn rectangle_and_line_are_symmetric_and_the_others_not() {
        use AntennaArray::*;
        for (array, symmetric) in
            [(Awr1843Aop, true), (Xwr1642Boost, true), (Xwr1843Boost, false), (Iwr6843Aop, false)]
        {
            let geometry = geometry(array);
            assert_eq!(geometry.opposite.is_some(), symmetric, "{array:?}");
            for (i, &j) in geometry.opposite.iter().flat_map(|o| o[..geometry.count].iter().enumerate()) {
                assert_eq!(geometry.opposite.unwrap()[j], i);
            }
        }
    }

    #[test]
    fn rectangles_are_found_where_they_are_full() {
        let count = |array, columns, rows| {
            geometry(array).rectangles(Subarray { columns, rows }).map_or(0, |(_, places)| places.len())
        };
        assert_eq!(count(AntennaArray::Awr1843Aop, 3, 2), 4);
        assert_eq!(count(AntennaArray::Awr1843Aop, 4, 3), 1);
        assert_eq!(count(AntennaArray::Awr1843Aop, 5, 1), 0);
        assert_eq!(count(AntennaArray::Xwr1642Boost, 6, 1), 3);
        assert_eq!(count(AntennaArray::Iwr6843Aop, 2, 2), 5);
        assert_eq!(count(AntennaArray::Awr1843Aop, 0, 2), 0);
    }
}
