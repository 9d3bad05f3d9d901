//! Where the virtual antennas of each board are.
//!
//! Positions are in half wavelengths, azimuth to the right and elevation upwards as seen from behind the board
//! (TI `antenna_geometry`, `gAntDef_*`). A virtual antenna is at the sum of its transmitter's and receiver's positions.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::radar::{MAX_RX, MAX_TX_SLOTS, MAX_VIRTUAL, RadarProfile};

/// Position of an antenna in half wavelengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Position {
    /// To the right.
    pub azimuth: i8,
    /// Upwards.
    pub elevation: i8,
}

const fn at(azimuth: i8, elevation: i8) -> Position {
    Position { azimuth, elevation }
}

/// The antennas of a radar board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AntennaArray {
    /// AWR1843AOP: full rectangle, 4 azimuth x 3 elevation.
    #[default]
    Awr1843Aop,
    /// xWR1843 BOOST: 8 in azimuth, 4 of them again in elevation.
    Xwr1843Boost,
    /// xWR1642 BOOST: 8 in azimuth, 2 transmitters.
    Xwr1642Boost,
    /// IWR6843AOP: L-shape.
    Iwr6843Aop,
}

impl AntennaArray {
    const fn tx(self) -> &'static [Position] {
        match self {
            Self::Awr1843Aop => const { &[at(0, 0), at(0, 1), at(0, 2)] },
            Self::Xwr1843Boost => const { &[at(0, 1), at(2, 0), at(4, 1)] },
            Self::Xwr1642Boost => const { &[at(0, 0), at(4, 0)] },
            Self::Iwr6843Aop => const { &[at(0, 0), at(2, 2), at(0, 2)] },
        }
    }

    const fn rx(self) -> &'static [Position] {
        match self {
            Self::Awr1843Aop => const { &[at(3, 0), at(2, 0), at(1, 0), at(0, 0)] },
            Self::Xwr1843Boost | Self::Xwr1642Boost => const { &[at(0, 0), at(1, 0), at(2, 0), at(3, 0)] },
            Self::Iwr6843Aop => const { &[at(1, 1), at(1, 0), at(0, 1), at(0, 0)] },
        }
    }

    /// Sign of each receiver's phase; IWR6843AOP feeds two of its patches from the other side.
    const fn rx_sign(self) -> &'static [i8] {
        match self {
            Self::Iwr6843Aop => &[-1, 1, -1, 1],
            _ => &[1, 1, 1, 1],
        }
    }
}

/// Turn of the board about its boresight, as seen from behind it, clockwise.
///
/// Two published tables of the AWR1843AOP differ by a quarter turn: it depends on how the board is mounted, so it is
/// configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mounting {
    /// As in TI's table.
    #[default]
    Upright,
    /// A quarter turn clockwise.
    Quarter,
    /// Upside down.
    Half,
    /// Three quarters of a turn clockwise.
    ThreeQuarters,
}

impl Mounting {
    const fn turn(self, p: Position) -> Position {
        match self {
            Self::Upright => p,
            Self::Quarter => at(p.elevation, -p.azimuth),
            Self::Half => at(-p.azimuth, -p.elevation),
            Self::ThreeQuarters => at(-p.elevation, p.azimuth),
        }
    }
}

/// One virtual antenna.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VirtualAntenna {
    /// Where it is, the board's mounting applied.
    pub position: Position,
    /// Sign by which its samples must be multiplied.
    pub sign: i8,
}

/// The physical antennas of a profile, the board's mounting applied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Elements {
    /// The transmitter of each slot of a loop, in the order of time.
    pub transmitters: Vec<Position, MAX_TX_SLOTS>,
    /// The receivers in use, each with the sign by which its samples must be multiplied.
    pub receivers: Vec<(Position, i8), MAX_RX>,
}

/// The physical antennas of `profile`, or `None` where the geometry is not defined: a slot with several transmitters at
/// once, or a transmitter that the board does not have.
pub fn elements(profile: &RadarProfile) -> Option<Elements> {
    let turn = |p: &Position| profile.mounting.turn(*p);
    let mut transmitters = Vec::new();
    for &mask in &profile.tx_order {
        if mask.count_ones() != 1 {
            return None;
        }
        transmitters.push(turn(profile.array.tx().get(mask.trailing_zeros() as usize)?)).ok()?;
    }
    let receivers = profile.array.rx().iter().zip(profile.array.rx_sign()).enumerate();
    let receivers = receivers.filter(|(index, _)| profile.rx_mask & (1 << index) != 0);
    Some(Elements { transmitters, receivers: receivers.map(|(_, (rx, &sign))| (turn(rx), sign)).collect() })
}

/// The virtual antennas of `profile` in cube order (`slot * rx_count + rx`), or `None` where [`elements`] is.
pub fn virtual_antennas(profile: &RadarProfile) -> Option<Vec<VirtualAntenna, MAX_VIRTUAL>> {
    let Elements { transmitters, receivers } = elements(profile)?;
    let pairs = transmitters.iter().flat_map(|tx| receivers.iter().map(move |rx| (tx, rx)));
    let antenna = |(tx, &(rx, sign)): (&Position, &(Position, i8))| VirtualAntenna {
        position: at(tx.azimuth + rx.azimuth, tx.elevation + rx.elevation),
        sign,
    };
    Some(pairs.map(antenna).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aop_is_a_full_rectangle() {
        let antennas = virtual_antennas(&RadarProfile::paper()).unwrap();
        for (v, antenna) in antennas.iter().enumerate() {
            let (slot, rx) = (v as i8 / 4, v as i8 % 4);
            assert_eq!(antenna.position, at(3 - rx, slot));
            assert_eq!(antenna.sign, 1);
        }
    }

    #[test]
    fn slots_follow_the_order_of_time() {
        let mut profile = RadarProfile { array: AntennaArray::Xwr1843Boost, ..RadarProfile::paper() };
        profile.tx_order = [0b001, 0b100, 0b010].into_iter().collect();
        let antennas = virtual_antennas(&profile).unwrap();
        // TX1 and TX3 make the row of eight, TX2 the one half a wavelength below it.
        let row: heapless::Vec<i8, 12> = antennas.iter().map(|a| a.position.azimuth).collect();
        assert_eq!(row.as_slice(), &[0, 1, 2, 3, 4, 5, 6, 7, 2, 3, 4, 5]);
        assert!(antennas[..8].iter().all(|a| a.position.elevation == 1));
        assert!(antennas[8..].iter().all(|a| a.position.elevation == 0));
    }

    #[test]
    fn a_quarter_turn_four_times_is_none() {
        let p = at(3, 1);
        let once = Mounting::Quarter.turn(p);
        let twice = Mounting::Quarter.turn(once);
        assert_eq!(twice, Mounting::Half.turn(p));
        assert_eq!(Mounting::Quarter.turn(twice), Mounting::ThreeQuarters.turn(p));
    }

    #[test]
    fn undefined_geometries_are_none() {
        let mut profile = RadarProfile { array: AntennaArray::Xwr1642Boost, ..RadarProfile::paper() };
        assert!(virtual_antennas(&profile).is_none(), "an xWR1642 has no third transmitter");
        profile.tx_order = [0b11].into_iter().collect();
        assert!(virtual_antennas(&profile).is_none(), "two transmitters at once");
    }
}
