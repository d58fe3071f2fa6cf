//! What moves within a frame: the camera of a film, and the moments that the shutter is open.

use std::{fmt, str::FromStr};

use kdray::scene::{Camera, Turntable};

use super::views::NamedPath;
use crate::cli::error::CliError;

/// The way of the camera.
pub enum CameraMotion<'a> {
    Path(NamedPath<'a>),
    Turn(Turntable),
}

impl CameraMotion<'_> {
    /// Returns the camera of a frame, which may lie between two whole frames.
    ///
    /// # Errors
    /// The camera sees nothing then.
    pub fn camera_at(&self, frame: f64) -> Result<Camera, CliError> {
        match self {
            Self::Path(path) => path.camera_at(frame),
            Self::Turn(turn) => Ok(turn.camera_at(frame)),
        }
    }
}

/// The time during which a picture is exposed, in frames from the picture's time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    open: f64,
    close: f64,
}

/// The share of the golden section. Its multiples without their whole parts fill an interval evenly, however many there
/// are, and follow no power of 2, as the random numbers of pixels do.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl Shutter {
    /// Returns the moment of a sample, in frames from the picture's time on. Each sample of a picture has one of its
    /// own, which is that of all pixels.
    pub fn moment(&self, sample_ix: u32) -> f64 {
        let share = (0.5 + GOLDEN * f64::from(sample_ix)).fract();
        self.open + share * (self.close - self.open)
    }
}

impl fmt::Display for Shutter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{},{}", self.open, self.close)
    }
}

impl FromStr for Shutter {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        let number = |digits: &str| digits.trim().parse().ok().filter(|x: &f64| x.abs() <= 1e6);
        let ends = word.split_once(',').and_then(|(open, close)| Some((number(open)?, number(close)?)));
        match ends {
            Some((open, close)) if open < close => Ok(Self { open, close }),
            Some(_) => Err("the shutter closes before it opens".to_owned()),
            None => Err("expected OPEN,CLOSE in frames, such as 0,0.5 or -0.25,0.25".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_fill_the_time_evenly() {
        let shutter: Shutter = "-0.25,0.25".parse().unwrap();
        for n in [4_u32, 16, 100, 1000] {
            let mut moments: Vec<f64> = (0..n).map(|ix| shutter.moment(ix)).collect();
            moments.sort_by(f64::total_cmp);
            let ends = [-0.25, 0.25];
            let all = ends[..1].iter().chain(&moments).chain(&ends[1..]).copied().collect::<Vec<_>>();
            let widest = all.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            assert!(all.is_sorted() && widest < 2.0 * 0.5 / f64::from(n), "{n}: {widest}");
            let mean = moments.iter().sum::<f64>() / f64::from(n);
            assert!(mean.abs() < 0.5 / f64::from(n), "{n}: {mean}");
        }
    }

    #[test]
    fn words() {
        let shutter = Shutter { open: 0.0, close: 0.5 };
        assert_eq!(("0, 0.5".parse(), shutter.to_string()), (Ok(shutter), "0,0.5".to_owned()));
        for word in ["", "0.5", "0.5,0.5", "1,0", "nan,1", "0,inf", "0,1,2"] {
            assert!(word.parse::<Shutter>().is_err(), "{word}");
        }
    }
}
