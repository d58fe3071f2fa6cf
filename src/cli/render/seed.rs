//! Which random numbers a picture has.

use std::str::FromStr;

use kdray::frame::PathOptions;

/// Value of `--seed`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seed {
    /// The same noise in all pictures.
    Fixed(u32),
    /// Other noise in each frame.
    Frame,
}

impl Seed {
    /// Returns the seed of a frame of this number. Those of the first 32,768 frames differ, and then they repeat.
    pub fn of_frame(self, frame: u32) -> u32 {
        match self {
            Self::Fixed(seed) => seed,
            Self::Frame => frame % (PathOptions::MOST_SEED + 1),
        }
    }
}

impl FromStr for Seed {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        if word == "frame" {
            return Ok(Self::Frame);
        }
        let seed = word.parse().ok().filter(|seed| *seed <= PathOptions::MOST_SEED);
        seed.map(Self::Fixed).ok_or_else(|| format!("expected a number from 0 to {}, or frame", PathOptions::MOST_SEED))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words() {
        assert_eq!("0".parse(), Ok(Seed::Fixed(0)));
        assert_eq!("32767".parse(), Ok(Seed::Fixed(32_767)));
        assert_eq!("frame".parse(), Ok(Seed::Frame));
        for word in ["", "-1", "32768", "1.5", "Frame"] {
            assert!(word.parse::<Seed>().is_err(), "{word}");
        }
        let of = |frame| (Seed::Fixed(7).of_frame(frame), Seed::Frame.of_frame(frame));
        assert_eq!([0, 9, 32_767, 32_768, 1_000_000].map(of), [(7, 0), (7, 9), (7, 32_767), (7, 0), (7, 16_960)]);
    }
}
