//! Words that name an option's variants, the same on the command line, in scene files and in JSON.

/// A word that names no variant of an option.
#[derive(Debug, thiserror::Error)]
#[error("`{word}` is not one of {expected}")]
pub struct UnknownWord {
    pub(crate) word: String,
    pub(crate) expected: String,
}

/// Implements `ALL`, `words`, `FromStr` and `Display` for an enum without fields.
macro_rules! named_enum {
    ($ty:ident { $($variant:ident = $word:literal),+ }) => {
        impl $ty {
            /// Every variant.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// Returns the words of all variants, separated by commas.
            pub fn words() -> String {
                [$($word),+].join(", ")
            }
        }
        impl std::str::FromStr for $ty {
            type Err = $crate::util::UnknownWord;
            fn from_str(word: &str) -> Result<Self, $crate::util::UnknownWord> {
                match word {
                    $($word => Ok(Self::$variant),)+
                    _ => Err($crate::util::UnknownWord { word: word.to_owned(), expected: Self::words() }),
                }
            }
        }
        impl std::fmt::Display for $ty {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str(match self { $(Self::$variant => $word),+ })
            }
        }
    };
}
