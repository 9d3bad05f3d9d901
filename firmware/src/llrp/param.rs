//! Reading of fields and parameters: bounded cursors over a message's body that cannot panic, with the place of an
//! error.
//!
//! [`Fields`] takes fixed fields from the front of a value; what is left are [`Parameters`]. A parameter of unknown
//! type is handed out like any other, since a TLV's length is known; only an unknown TV ends the walk.

use core::fmt;

use super::message::{CUSTOM_PARAMETER, ParameterType};

/// Where and why a message does not decode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DecodeError {
    /// Offset in the message's body, bytes.
    pub offset: usize,
    /// What is wrong there.
    pub fault: Fault,
}

/// What is wrong with a field or parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The value ends before the field or parameter does.
    Truncated,
    /// A TLV whose length is less than its own header.
    Length(u16),
    /// A TV of this type, whose length LLRP 1.0.1 does not define.
    UnknownTv(u8),
    /// A field has a value outside its range.
    Value,
    /// A parameter that the message must have is not there.
    Missing(ParameterType),
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.fault {
            Fault::Truncated => write!(f, "truncated")?,
            Fault::Length(n) => write!(f, "parameter length {n} is less than its header")?,
            Fault::UnknownTv(t) => write!(f, "TV parameter of unknown type {t}")?,
            Fault::Value => write!(f, "value out of range")?,
            Fault::Missing(p) => write!(f, "no {p:?} parameter")?,
        }
        write!(f, " at byte {} of the message's body", self.offset)
    }
}

impl core::error::Error for DecodeError {}

/// Cursor over the fixed fields of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fields<'a> {
    rest: &'a [u8],
    offset: usize,
}

impl<'a> Fields<'a> {
    /// A cursor over a message's body.
    pub fn new(body: &'a [u8]) -> Self {
        Self { rest: body, offset: 0 }
    }

    /// Bytes not yet read.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Error of this kind at the cursor.
    pub fn error(&self, fault: Fault) -> DecodeError {
        DecodeError { offset: self.offset, fault }
    }

    /// The next `n` bytes.
    ///
    /// # Errors
    /// [`Fault::Truncated`], as in all methods below.
    pub fn bytes(&mut self, n: usize) -> Result<&'a [u8], DecodeError> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or(self.error(Fault::Truncated))?;
        self.rest = rest;
        self.offset = self.offset.saturating_add(n);
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let (taken, rest) = self.rest.split_first_chunk::<N>().ok_or(self.error(Fault::Truncated))?;
        self.rest = rest;
        self.offset = self.offset.saturating_add(N);
        Ok(*taken)
    }

    /// u8.
    pub fn u8(&mut self) -> Result<u8, DecodeError> {
        self.array().map(u8::from_be_bytes)
    }

    /// s8.
    pub fn i8(&mut self) -> Result<i8, DecodeError> {
        self.array().map(i8::from_be_bytes)
    }

    /// u16.
    pub fn u16(&mut self) -> Result<u16, DecodeError> {
        self.array().map(u16::from_be_bytes)
    }

    /// s16.
    pub fn i16(&mut self) -> Result<i16, DecodeError> {
        self.array().map(i16::from_be_bytes)
    }

    /// u32.
    pub fn u32(&mut self) -> Result<u32, DecodeError> {
        self.array().map(u32::from_be_bytes)
    }

    /// u64.
    pub fn u64(&mut self) -> Result<u64, DecodeError> {
        self.array().map(u64::from_be_bytes)
    }

    /// Text of u16 bytes of UTF-8; what is not UTF-8 cuts it short.
    pub fn text(&mut self) -> Result<&'a str, DecodeError> {
        let n = self.u16()?;
        let bytes = self.bytes(usize::from(n))?;
        Ok(bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid()))
    }

    /// What is left, as parameters.
    pub fn parameters(self) -> Parameters<'a> {
        Parameters { fields: self }
    }
}

/// One parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter<'a> {
    /// Type.
    pub kind: ParameterType,
    /// Value: for a TLV without type and length, for a custom one also without vendor and subtype.
    pub fields: Fields<'a>,
}

/// Iterator over the parameters of a value; ends after the first error.
#[derive(Debug, Clone, Copy)]
pub struct Parameters<'a> {
    fields: Fields<'a>,
}

impl<'a> Parameters<'a> {
    /// The parameters of a message's body that has no fields before them.
    pub fn new(body: &'a [u8]) -> Self {
        Fields::new(body).parameters()
    }

    /// The value of the first parameter of this type.
    ///
    /// # Errors
    /// [`Fault::Missing`] if there is none, or what is wrong before it.
    pub fn find(mut self, kind: ParameterType) -> Result<Fields<'a>, DecodeError> {
        let start = self.fields;
        for parameter in &mut self {
            let parameter = parameter?;
            if parameter.kind == kind {
                return Ok(parameter.fields);
            }
        }
        Err(start.error(Fault::Missing(kind)))
    }

    fn parameter(&mut self) -> Result<Parameter<'a>, DecodeError> {
        let start = self.fields;
        let first = self.fields.u8()?;
        if first & 0x80 != 0 {
            let kind = first & 0x7F;
            let length = ParameterType::tv_length(kind).ok_or(start.error(Fault::UnknownTv(kind)))?;
            let value = Fields { rest: self.fields.bytes(length)?, offset: start.offset.saturating_add(1) };
            return Ok(Parameter { kind: ParameterType::Tv(kind), fields: value });
        }
        let mut header = start;
        // The 6 bits before the type are reserved: what they hold is ignored.
        let kind = header.u16()? & 0x03FF;
        let length = header.u16()?;
        let body = usize::from(length).checked_sub(4).ok_or(start.error(Fault::Length(length)))?;
        let offset = header.offset;
        let mut value = Fields { rest: header.bytes(body)?, offset };
        self.fields = header;
        let kind = if kind == CUSTOM_PARAMETER {
            ParameterType::Custom { vendor: value.u32()?, subtype: value.u32()? }
        } else {
            ParameterType::Tlv(kind)
        };
        Ok(Parameter { kind, fields: value })
    }
}

impl<'a> Iterator for Parameters<'a> {
    type Item = Result<Parameter<'a>, DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.fields.rest.is_empty() {
            return None;
        }
        let parameter = self.parameter();
        if parameter.is_err() {
            self.fields.rest = &[];
        }
        Some(parameter)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn each_framing_is_read() {
        let body = [
            0x81, 0, 3, // AntennaID
            0x01, 0x01, 0, 4, // ConnectionCloseEvent
            0x03, 0xFF, 0, 14, 0, 0, 0x65, 0x1A, 0, 0, 0, 56, 0x0A, 0x30, // ImpinjRFPhaseAngle
        ];
        let all: Vec<_> = Parameters::new(&body).map(Result::unwrap).collect();
        let kinds: Vec<_> = all.iter().map(|p| p.kind).collect();
        use ParameterType as P;
        assert_eq!(kinds, [P::ANTENNA_ID, P::CONNECTION_CLOSE_EVENT, P::IMPINJ_RF_PHASE_ANGLE]);
        assert_eq!(all[0].fields.rest(), [0, 3]);
        assert_eq!(all[1].fields.rest(), []);
        assert_eq!(all[2].fields, Fields { rest: &[0x0A, 0x30], offset: 19 });
    }

    #[test]
    fn errors_name_their_place() {
        let error = |body: &[u8]| {
            let mut parameters = Parameters::new(body);
            let error = parameters.by_ref().find_map(Result::err).unwrap();
            assert_eq!(parameters.next(), None, "the walk ends");
            (error.offset, error.fault)
        };
        assert_eq!(error(&[0x81, 0]), (1, Fault::Truncated));
        assert_eq!(error(&[0x81, 0, 1, 0x01]), (3, Fault::Truncated));
        assert_eq!(error(&[0x81, 0, 1, 0x01, 0x00, 0, 3]), (3, Fault::Length(3)));
        assert_eq!(error(&[0xFF]), (0, Fault::UnknownTv(0x7F)));
        assert_eq!(error(&[0x80]), (0, Fault::UnknownTv(0)));
        assert_eq!(error(&[0x03, 0xFF, 0, 6, 0, 0]), (4, Fault::Truncated));
        let missing = Parameters::new(&[0x81, 0, 1]).find(ParameterType::LLRP_STATUS);
        assert_eq!(missing.unwrap_err().fault, Fault::Missing(ParameterType::LLRP_STATUS));
    }

    #[test]
    fn text_stops_where_it_is_no_utf8() {
        assert_eq!(Fields::new(&[0, 3, b'a', 0xFF, b'b']).text(), Ok("a"));
        assert_eq!(Fields::new(&[0, 0]).text(), Ok(""));
        assert!(Fields::new(&[0, 2, b'a']).text().is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_end_and_stay_in_bounds(body in proptest::collection::vec(any::<u8>(), 0..300)) {
            let mut seen = 0;
            for parameter in Parameters::new(&body) {
                match parameter {
                    Ok(p) => {
                        prop_assert!(p.fields.offset + p.fields.rest.len() <= body.len());
                        prop_assert_eq!(&body[p.fields.offset..][..p.fields.rest.len()], p.fields.rest);
                    }
                    Err(e) => prop_assert!(e.offset <= body.len()),
                }
                seen += 1;
            }
            prop_assert!(seen <= body.len());
        }
    }
}
