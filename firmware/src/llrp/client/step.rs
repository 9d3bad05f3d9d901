//! The requests between connecting and reading, and their order.

use crate::llrp::message::MessageType;

/// One request of the setup.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    Extensions,
    Capabilities,
    Settings,
    DeleteAccessSpecs,
    /// All of them.
    DeleteRoSpecs,
    /// This client's, which a lost link may have left, on a reader that does not delete all at once.
    DeleteOwnRoSpec,
    AddRoSpec,
    EnableRoSpec,
    StartRoSpec,
}

impl Step {
    pub(super) const FIRST: Self = Self::Extensions;

    /// What is asked.
    pub(super) fn request(self) -> MessageType {
        match self {
            Self::Extensions => MessageType::CUSTOM_MESSAGE,
            Self::Capabilities => MessageType::GET_READER_CAPABILITIES,
            Self::Settings => MessageType::SET_READER_CONFIG,
            Self::DeleteAccessSpecs => MessageType::DELETE_ACCESSSPEC,
            Self::DeleteRoSpecs | Self::DeleteOwnRoSpec => MessageType::DELETE_ROSPEC,
            Self::AddRoSpec => MessageType::ADD_ROSPEC,
            Self::EnableRoSpec => MessageType::ENABLE_ROSPEC,
            Self::StartRoSpec => MessageType::START_ROSPEC,
        }
    }

    /// The step after this one was granted; `None` after the last.
    pub(super) fn after_success(self) -> Option<Self> {
        Some(match self {
            Self::Extensions => Self::Capabilities,
            Self::Capabilities => Self::Settings,
            Self::Settings => Self::DeleteAccessSpecs,
            Self::DeleteAccessSpecs => Self::DeleteRoSpecs,
            Self::DeleteRoSpecs | Self::DeleteOwnRoSpec => Self::AddRoSpec,
            Self::AddRoSpec => Self::EnableRoSpec,
            Self::EnableRoSpec => Self::StartRoSpec,
            Self::StartRoSpec => return None,
        })
    }

    /// The step after this one was refused; `None` where reading depends on it.
    ///
    /// A reader may refuse to delete what is not there. Where something is, it will refuse the ROSpec.
    pub(super) fn after_refusal(self) -> Option<Self> {
        Some(match self {
            Self::Extensions => Self::Capabilities,
            Self::DeleteAccessSpecs => Self::DeleteRoSpecs,
            Self::DeleteRoSpecs => Self::DeleteOwnRoSpec,
            Self::DeleteOwnRoSpec => Self::AddRoSpec,
            _ => return None,
        })
    }
}
