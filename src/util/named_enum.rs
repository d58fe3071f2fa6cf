//! Words for an option's variants, for the command line, scene files and JSON alike.

/// A word that names no variant of an option.
#[derive(Debug, thiserror::Error)]
#[error("`{word}` is not one of {expected}")]
pub struct UnknownWord {
    pub(crate) word: String,
    pub(crate) expected: String,
}

/// `ALL`, `words`, `FromStr` and `Display` of an enum without fields.
macro_rules! named_enum {
    ($ty:ident { $($variant:ident = $word:literal),+ }) => {
        impl $ty {
            /// Every variant.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The words of all variants, with commas.
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
