//! Words that name an option's variants, the same on the command line, in scene files and in JSON.

/// A word that names no variant of an option.
#[derive(Debug, thiserror::Error)]
pub enum UnknownWord {
    /// The word never named a variant.
    #[error("`{word}` is not one of {expected}")]
    Unknown {
        /// The word.
        word: String,
        /// The words of all variants, separated by commas.
        expected: String,
    },
    /// The word named a variant once.
    #[error("`{word}` is now called `{now}`")]
    Renamed {
        /// The word.
        word: String,
        /// The variant's word.
        now: &'static str,
    },
}

/// Implements `ALL`, `words`, `FromStr` and `Display` for an enum without fields.
///
/// Either all words or none are followed by a description, `Mask = "mask": "what the variant does"`. With
/// descriptions, the macro also implements `descriptions`, which lists them for a help text. After such variants,
/// `renamed { "old" => "new" }` may list former words. An error that names the new word refuses each of them.
macro_rules! named_enum {
    (@common $ty:ident { $($variant:ident = $word:literal),+ } renamed { $($old:literal => $now:literal),* }) => {
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
                    $($old => Err($crate::util::UnknownWord::Renamed { word: word.to_owned(), now: $now }),)*
                    _ => Err($crate::util::UnknownWord::Unknown { word: word.to_owned(), expected: Self::words() }),
                }
            }
        }
        impl std::fmt::Display for $ty {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str(match self { $(Self::$variant => $word),+ })
            }
        }
    };
    ($ty:ident { $($variant:ident = $word:literal),+ $(,)? }) => {
        named_enum!(@common $ty { $($variant = $word),+ } renamed {});
    };
    (
        $ty:ident { $($variant:ident = $word:literal : $description:literal),+ $(,)? }
        $(renamed { $($old:literal => $now:literal),* })?
    ) => {
        named_enum!(@common $ty { $($variant = $word),+ } renamed { $($($old => $now),*)? });
        impl $ty {
            /// Returns a list of all words, one in a line, each with what its variant does.
            pub fn descriptions() -> String {
                [$(concat!("- ", $word, ": ", $description)),+].join("\n")
            }
        }
    };
}
