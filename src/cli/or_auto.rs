//! Values of options that may be `auto`: kdray then chooses.

use std::str::FromStr;

use kdray::util::UnknownWord;

/// Value of an option: a certain variant, or `auto` for the one that suits best.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrAuto<T> {
    Auto,
    Pinned(T),
}

impl<T> OrAuto<T> {
    /// Returns the variant, or none for `auto`.
    pub fn pinned(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Pinned(variant) => Some(variant),
        }
    }
}

impl<T: FromStr<Err = UnknownWord>> FromStr for OrAuto<T> {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "auto" => Ok(Self::Auto),
            _ => word.parse().map(Self::Pinned).map_err(|error| match error {
                UnknownWord::Unknown { .. } => format!("{error}, auto"),
                UnknownWord::Renamed { .. } => error.to_string(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use kdray::frame::Primary;

    use super::*;

    #[test]
    fn auto_is_a_word_beside_the_variants() {
        assert_eq!("auto".parse(), Ok(OrAuto::<Primary>::Auto));
        assert_eq!("trace".parse::<OrAuto<Primary>>().unwrap().pinned(), Some(Primary::Trace));
        let error = "Auto".parse::<OrAuto<Primary>>().unwrap_err();
        assert_eq!(error, "`Auto` is not one of raster, software-raster, trace, auto");
    }

    #[test]
    fn an_old_word_is_refused_by_the_new_one() {
        let error = "compute".parse::<OrAuto<Primary>>().unwrap_err();
        assert_eq!(error, "`compute` is now called `software-raster`");
    }
}
