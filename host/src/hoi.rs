//! The vocabulary: actions, objects, and the tuples of both.
//!
//! Seven actions on eight objects make the paper's 17 categories (section 4.2); five more objects are never trained on
//! with their own signals and are for tests.

use serde::{Deserialize, Serialize};

macro_rules! names {
    ($(#[$doc:meta])* $type:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum $type {
            $(#[doc = concat!("\"", $name, "\"")] #[serde(rename = $name)] $variant),+
        }

        impl $type {
            /// All of them, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// What people call it.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }

            /// The one of this name.
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|x| x.name() == name)
            }

            /// Its number in [`Self::ALL`].
            pub const fn index(self) -> usize {
                self as usize
            }
        }

        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

names! {
    /// What a person does.
    Action {
        PickUp = "pick up",
        PutDown = "put down",
        Open = "open",
        Close = "close",
        Wipe = "wipe",
        SitDown = "sit down",
        StandUp = "stand up",
    }
}

names! {
    /// What it is done to. The first eight are the paper's, the last five its unseen ones.
    Object {
        Phone = "phone",
        Book = "book",
        Pen = "pen",
        Bottle = "bottle",
        Microwave = "microwave",
        Cabinet = "cabinet",
        Table = "table",
        Chair = "chair",
        Jar = "jar",
        Lunchbox = "lunchbox",
        Bowl = "bowl",
        Cup = "cup",
        EyeglassCase = "eyeglass case",
    }
}

/// An action on an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Category {
    /// What is done.
    pub action: Action,
    /// To what.
    pub object: Object,
}

impl core::fmt::Display for Category {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "<{}, {}>", self.action, self.object)
    }
}

const fn does(action: Action, object: Object) -> Category {
    Category { action, object }
}

/// The 17 categories of the paper.
pub const CATEGORIES: [Category; 17] = {
    use {Action::*, Object::*};
    [
        does(PickUp, Phone),
        does(PickUp, Book),
        does(PickUp, Pen),
        does(PickUp, Bottle),
        does(PutDown, Phone),
        does(PutDown, Book),
        does(PutDown, Pen),
        does(PutDown, Bottle),
        does(Open, Book),
        does(Open, Microwave),
        does(Open, Cabinet),
        does(Close, Book),
        does(Close, Microwave),
        does(Close, Cabinet),
        does(Wipe, Table),
        does(SitDown, Chair),
        does(StandUp, Chair),
    ]
};

/// The ten categories of objects that are not among the paper's eight (section 5.4.2).
pub const UNSEEN: [Category; 10] = {
    use {Action::*, Object::*};
    [
        does(PickUp, Jar),
        does(PickUp, Lunchbox),
        does(PickUp, Bowl),
        does(PickUp, Cup),
        does(PickUp, EyeglassCase),
        does(PutDown, Jar),
        does(PutDown, Lunchbox),
        does(PutDown, Bowl),
        does(PutDown, Cup),
        does(PutDown, EyeglassCase),
    ]
};

impl Action {
    /// Whether its motion is the same whatever the object is, so that another object can take the place of the one
    /// that was simulated (the list A of the paper's algorithm 1).
    pub const fn is_object_agnostic(self) -> bool {
        matches!(self, Self::PickUp | Self::PutDown)
    }

    /// What it is when it is played backwards.
    pub const fn reversed(self) -> Self {
        match self {
            Self::PickUp => Self::PutDown,
            Self::PutDown => Self::PickUp,
            Self::Open => Self::Close,
            Self::Close => Self::Open,
            Self::Wipe => Self::Wipe,
            Self::SitDown => Self::StandUp,
            Self::StandUp => Self::SitDown,
        }
    }
}

impl Object {
    /// Whether it is held in a hand and carried.
    pub const fn is_carried(self) -> bool {
        !matches!(self, Self::Microwave | Self::Cabinet | Self::Table | Self::Chair)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn categories_are_those_of_the_paper() {
        let actions: std::collections::BTreeSet<_> = CATEGORIES.iter().map(|c| c.action).collect();
        let objects: std::collections::BTreeSet<_> = CATEGORIES.iter().map(|c| c.object).collect();
        let all: std::collections::BTreeSet<_> = CATEGORIES.iter().chain(&UNSEEN).collect();
        assert_eq!((actions.len(), objects.len(), all.len()), (7, 8, 27));
        assert!(objects.iter().all(|o| o.index() < 8));
        assert!(UNSEEN.iter().all(|c| c.object.index() >= 8 && c.object.is_carried()));
    }

    #[test]
    fn names_lead_back() {
        assert_eq!(Object::named("eyeglass case"), Some(Object::EyeglassCase));
        assert_eq!(Action::named("juggle"), None);
        assert_eq!(CATEGORIES[1].to_string(), "<pick up, book>");
    }
}
