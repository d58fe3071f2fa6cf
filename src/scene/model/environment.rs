//! The environment: an image of what is seen beyond the scene in all directions.

use std::sync::Arc;

use glam::Vec3;

/// The greatest radiance of a texel, far above that of the sun in any unit. Sums and quotients of it are finite.
const MOST_RADIANCE: f32 = 1.0e12;

/// An equirectangular image of what rays see that leave the scene. Only the path tracer knows it. A clone shares the
/// pixels.
///
/// The image's first row is the zenith, +y, and its last one -y. Its middle is in the direction -z, and the quarter to
/// the right of it is +x.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    size: [u32; 2],
    colours: Arc<[Vec3]>,
    rotation_degrees: f32,
}

/// How many texels of an image were no radiance, and have been replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MendedTexels {
    /// Texels with a NaN, which has become 0.
    pub n_nan: usize,
    /// Texels with a negative number, which has become 0.
    pub n_negative: usize,
    /// Texels with a number that is infinite or above 1e12. It has become 1e12, or the greatest of the image's other
    /// numbers.
    pub n_infinite: usize,
}

impl Environment {
    /// Makes an environment from the linear colours of an image, row by row. `rotation_degrees`: by which it is turned
    /// about +y, counter-clockwise as seen from above. `strength`: factor on the colours.
    ///
    /// NaNs, negative and infinite numbers are replaced by numbers that are finite and not negative. Returns how many
    /// texels have such numbers.
    ///
    /// # Errors
    /// The number of colours is not that of an image of this size with at least one pixel. The rotation is not finite.
    /// The strength is not finite or is negative.
    pub fn new(
        size: [u32; 2],
        mut colours: Vec<Vec3>,
        (rotation_degrees, strength): (f32, f32),
    ) -> Result<(Self, MendedTexels), String> {
        let [width, height] = size;
        if colours.is_empty() || colours.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(format!("{} colours are not those of {width} x {height} pixels", colours.len()));
        }
        if !(rotation_degrees.is_finite() && strength >= 0.0 && strength.is_finite()) {
            return Err(format!("a rotation of {rotation_degrees} degrees or a strength of {strength} is no number"));
        }
        let usual = |component: &f32| *component >= 0.0 && *component <= MOST_RADIANCE;
        let components = colours.iter().flat_map(|colour| colour.to_array());
        let greatest = components.filter(usual).fold(0.0, f32::max);
        let mut mended = MendedTexels::default();
        for colour in &mut colours {
            let components = colour.to_array();
            mended.n_nan += usize::from(components.iter().any(|component| component.is_nan()));
            mended.n_negative += usize::from(components.iter().any(|component| *component < 0.0));
            mended.n_infinite += usize::from(components.iter().any(|component| *component > MOST_RADIANCE));
            // The greatest of the other numbers stands for an infinite one.
            let mend = |component: f32| if component > MOST_RADIANCE { greatest } else { component.max(0.0) };
            *colour = (Vec3::from_array(components.map(mend)) * strength).min(Vec3::splat(MOST_RADIANCE));
        }
        Ok((Self { size, colours: colours.into(), rotation_degrees }, mended))
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The radiance of each pixel, row by row.
    pub fn colours(&self) -> &[Vec3] {
        &self.colours
    }

    /// By how much the image is turned about +y, in turns from 0 to 1, counter-clockwise as seen from above.
    pub fn turn(&self) -> f32 {
        (f64::from(self.rotation_degrees) / 360.0).rem_euclid(1.0) as f32
    }

    /// Returns whether no light comes from anywhere.
    pub fn is_black(&self) -> bool {
        self.colours.iter().all(|colour| *colour == Vec3::ZERO)
    }
}

impl MendedTexels {
    /// Returns what is wrong with the image, or `None` if nothing is.
    pub fn message(&self) -> Option<String> {
        let Self { n_nan, n_negative, n_infinite } = *self;
        let (kinds, n) = ([(n_nan, "NaN"), (n_negative, "negative"), (n_infinite, "infinite")], n_nan + n_negative);
        if n + n_infinite == 0 {
            return None;
        }
        let counts: Vec<_> = kinds.iter().filter(|(n, _)| *n > 0).map(|(n, kind)| format!("{n} {kind}")).collect();
        Some(format!(
            "has pixels that are no radiance ({}): NaN and negative become 0, infinite becomes the greatest of the \
             other numbers",
            counts.join(", ")
        ))
    }
}
