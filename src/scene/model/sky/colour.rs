//! Linear sRGB of luminances in the colour space of the CIE (IEC 61966-2-1).

use glam::{DMat3, DVec3};

/// Returns linear sRGB of X, Y and Z. Colours outside of sRGB are clamped to it.
pub(super) fn rgb_of_xyz(xyz: DVec3) -> DVec3 {
    let columns = [[3.2406, -0.9689, 0.0557], [-1.5372, 1.8758, -0.2040], [-0.4986, 0.0415, 1.0570]];
    (DMat3::from_cols_array_2d(&columns) * xyz).max(DVec3::ZERO)
}

/// Returns linear sRGB of the chromaticities x and y and the luminance Y.
pub(super) fn rgb_of_xyy(DVec3 { x, y, z: luminance }: DVec3) -> DVec3 {
    rgb_of_xyz(DVec3::new(x, y, 1.0 - x - y) * (luminance / y))
}
