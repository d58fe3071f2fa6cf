//! Options that the user may leave to kdray.

use std::str::FromStr;

use kdray::util::UnknownWord;

/// What a user wants: a certain variant of an option, or whichever suits best.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted<T> {
    Auto,
    This(T),
}

impl<T> Wanted<T> {
    /// The variant, if it is a certain one.
    pub fn pinned(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::This(variant) => Some(variant),
        }
    }
}

impl<T: FromStr<Err = UnknownWord>> FromStr for Wanted<T> {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "auto" => Ok(Self::Auto),
            _ => word.parse().map(Self::This).map_err(|error| format!("{error}, auto")),
        }
    }
}

#[cfg(test)]
mod tests {
    use kdray::frame::Primary;

    use super::*;

    #[test]
    fn auto_is_a_word_beside_the_variants() {
        assert_eq!("auto".parse(), Ok(Wanted::<Primary>::Auto));
        assert_eq!("trace".parse::<Wanted<Primary>>().unwrap().pinned(), Some(Primary::Trace));
        let error = "Auto".parse::<Wanted<Primary>>().unwrap_err();
        assert_eq!(error, "`Auto` is not one of raster, compute, trace, auto");
    }
}
