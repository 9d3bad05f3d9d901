//! `LLRPStatus`: the outcome of a request, and what in it was refused (LLRP 1.0.1 section 14).

use core::fmt;

use super::message::ParameterType;
use super::param::{DecodeError, Fields, Parameters};

/// Status code, also of a field or parameter error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StatusCode(pub u16);

impl StatusCode {
    /// `M_Success`.
    pub const SUCCESS: Self = Self(0);
    /// `M_ParameterError`.
    pub const PARAMETER_ERROR: Self = Self(100);
    /// `M_FieldError`.
    pub const FIELD_ERROR: Self = Self(101);
    /// `M_UnsupportedMessage`.
    pub const UNSUPPORTED_MESSAGE: Self = Self(109);

    /// Name in the specification, or `None` for a code that it does not define.
    pub fn name(self) -> Option<&'static str> {
        Some(match self.0 {
            0 => "M_Success",
            100 => "M_ParameterError",
            101 => "M_FieldError",
            102 => "M_UnexpectedParameter",
            103 => "M_MissingParameter",
            104 => "M_DuplicateParameter",
            105 => "M_OverflowParameter",
            106 => "M_OverflowField",
            107 => "M_UnknownParameter",
            108 => "M_UnknownField",
            109 => "M_UnsupportedMessage",
            110 => "M_UnsupportedVersion",
            111 => "M_UnsupportedParameter",
            200 => "P_ParameterError",
            201 => "P_FieldError",
            202 => "P_UnexpectedParameter",
            203 => "P_MissingParameter",
            204 => "P_DuplicateParameter",
            205 => "P_OverflowParameter",
            206 => "P_OverflowField",
            207 => "P_UnknownParameter",
            208 => "P_UnknownField",
            209 => "P_UnsupportedParameter",
            300 => "A_Invalid",
            301 => "A_OutOfRange",
            401 => "R_DeviceError",
            _ => return None,
        })
    }
}

impl fmt::Display for StatusCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "status {}", self.0),
        }
    }
}

/// Outcome of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status<'a> {
    /// Code.
    pub code: StatusCode,
    /// The reader's words, often empty.
    pub description: &'a str,
    /// Type of the innermost parameter that the reader objects to.
    pub parameter: Option<u16>,
    /// Number of the field that it objects to, from 0, in that parameter or else in the message.
    pub field: Option<u16>,
}

impl<'a> Status<'a> {
    /// The status of a response whose body this is.
    ///
    /// # Errors
    /// If there is no `LLRPStatus`, or it is malformed.
    pub fn of_response(body: Parameters<'a>) -> Result<Self, DecodeError> {
        Self::decode(body.find(ParameterType::LLRP_STATUS)?)
    }

    /// From the value of an `LLRPStatus` parameter.
    ///
    /// # Errors
    /// If it is malformed.
    pub fn decode(mut value: Fields<'a>) -> Result<Self, DecodeError> {
        let code = StatusCode(value.u16()?);
        let description = value.text()?;
        let mut status = Self { code, description, parameter: None, field: None };
        let mut parameters = value.parameters();
        // Errors nest: parameter in parameter, and a field in the innermost. Each level is shorter than the last.
        while let Some(parameter) = parameters.next() {
            let parameter = parameter?;
            let mut fields = parameter.fields;
            match parameter.kind {
                ParameterType::FIELD_ERROR => status.field = Some(fields.u16()?),
                ParameterType::PARAMETER_ERROR => {
                    status.parameter = Some(fields.u16()?);
                    fields.u16()?;
                    parameters = fields.parameters();
                }
                _ => {}
            }
        }
        Ok(status)
    }
}
