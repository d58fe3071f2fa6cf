//! Tests that a crop of a picture is the same, bit for bit, as that part of the whole picture.

use kdray::{
    frame::{Crop, Denoise, Picture, Primary, RenderOptions},
    reference,
};

use super::studio::{identical, options, samples_on_cpu as on_cpu, samples_on_device as on_device};
use crate::support::scenes;

const SIZE: (u32, u32) = (61, 47);

const CROPS: [Crop; 5] = [
    Crop { x0: 0, y0: 0, x1: 61, y1: 47 },
    Crop { x0: 0, y0: 0, x1: 1, y1: 1 },
    Crop { x0: 60, y0: 46, x1: 61, y1: 47 },
    Crop { x0: 13, y0: 9, x1: 50, y1: 31 },
    Crop { x0: 0, y0: 20, x1: 61, y1: 21 },
];

fn cut(whole: &Picture, crop: Crop) -> Picture {
    let pixels = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (y * whole.width + x) as usize));
    let (radiance, display) = pixels.map(|i| (whole.radiance[i], whole.display[i])).unzip();
    Picture { width: crop.width(), height: crop.height(), radiance, display }
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let perspective = scenes::mixed_outdoors();
    let orthographic = scenes::orthographic(perspective.clone());
    let filter = Denoise::Paper { threshold: 0.1 };
    for (scene, primary, denoise, n_samples) in [
        (&perspective, Primary::Raster, filter, 1),
        (&perspective, Primary::Trace, filter, 1),
        (&perspective, Primary::Raster, Denoise::Off, 3),
        (&orthographic, Primary::Raster, filter, 2),
    ] {
        let whole = RenderOptions { primary, denoise, ..options(SIZE.0, SIZE.1, 4) };
        for (name, render) in [("device", on_device as fn(&_, &_, _) -> _), ("cpu", on_cpu)] {
            let picture = render(scene, &whole, n_samples);
            for crop in CROPS {
                let part = render(scene, &RenderOptions { crop: Some(crop), ..whole.clone() }, n_samples);
                assert!(identical(&cut(&picture, crop), &part), "{name}, {primary}, {denoise:?}: {crop}");
            }
        }
    }
}

/// The filter needs a border around the crop; without it, pixels at the edge would have other neighbours.
#[test]
fn the_filter_s_border_matters() {
    let scene = scenes::mixed_outdoors();
    let options = RenderOptions { denoise: Denoise::Paper { threshold: 0.1 }, ..options(SIZE.0, SIZE.1, 4) };
    let whole = on_cpu(&scene, &options, 1);
    let crop = Crop { x0: 13, y0: 9, x1: 50, y1: 31 };
    let beside = Crop { x0: 12, x1: 49, ..crop };
    assert!(!identical(&cut(&whole, crop), &cut(&whole, beside)));
    let without_border = RenderOptions { denoise: Denoise::Off, crop: Some(crop), ..options };
    let unfiltered = on_cpu(&scene, &without_border, 1);
    let frame = kdray::layout::Frame {
        width: crop.width(),
        height: crop.height(),
        exposure: 1.0,
        denoise_threshold: 0.1,
        ..Default::default()
    };
    let mut filtered = unfiltered.radiance.clone();
    reference::denoise::denoise(&frame, &unfiltered.radiance, &mut filtered);
    assert_ne!(filtered, cut(&whole, crop).radiance);
}
