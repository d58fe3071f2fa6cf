//! Maps whose images are in tiles (UDIM), and images of colours that are cut out.

use glam::Vec2;
use kdray::scene::{Alpha, Channel, Image, Material, Pixels, Scene, source_files};

use super::{materials::png, strangers::loaded};

/// Four triangles, in the tiles 1001, 1002, 1011 and 1003.
const TILED: &str = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\n\
                     vt 1 1\nvt 0 2\nvt 1 2\nvt 3 0\nvt 2 1\nf 1/1 2/2 3/3\n\
                     f 1/2 2/4 4/5\nf 1/3 3/5 4/6\nf 2/4 3/8 4/9\n";

fn load(mtl: &str, images: &[&str]) -> (Scene, Vec<String>) {
    let files: Vec<(&str, Vec<u8>)> =
        images.iter().map(|name| (*name, png(|_, _| [name.as_bytes()[5], 0, 0, 255]))).collect();
    let images = files.iter().map(|(name, bytes)| (*name, &bytes[..]));
    let texts = [("m.obj", TILED.as_bytes()), ("m.mtl", mtl.as_bytes())];
    loaded(&texts.into_iter().chain(images).collect::<Vec<_>>())
}

fn of_face(scene: &Scene, face: usize) -> &Material {
    let materials = &scene.instances[0].materials;
    &scene.materials[materials[scene.meshes[0].slots[face] as usize] as usize]
}

/// The image of a face's colour, and where in it the first corner of the face is.
fn shown(scene: &Scene, face: usize) -> Option<(&Image, Vec2)> {
    let texture = of_face(scene, face).maps.base_colour.as_ref()?;
    let at = texture.transform.transform_point2(scene.meshes[0].uvs[0][face][0]);
    Some((&scene.images[texture.image_ix as usize], at))
}

#[test]
fn each_tile_has_its_own_image() {
    for name in ["a.<UDIM>.png", "a.1001.png"] {
        let (scene, warnings) =
            load(&format!("newmtl m\nmap_Kd {name}\nKs 0.5\n"), &["a.1001.png", "a.1002.png", "a.1011.png"]);
        let seen = |face: usize| shown(&scene, face).map(|(image, at)| (&image.name[..], at));
        // (0, 1) is the lower left corner of an image.
        assert_eq!(seen(0), Some(("a.1001.png", Vec2::new(0.0, 1.0))));
        assert_eq!(seen(1), Some(("a.1002.png", Vec2::new(0.0, 1.0))));
        assert_eq!(seen(2), Some(("a.1011.png", Vec2::new(0.0, 1.0))));
        assert_eq!((seen(3), of_face(&scene, 3).ks.x), (None, 0.5));
        assert!(warnings.len() == 1 && warnings[0].contains("1 triangles are in tiles (UDIM)"), "{warnings:?}");
        assert_eq!(scene.images.len(), 3);
    }
    // A number alone is part of a name.
    let (scene, warnings) = load("newmtl m\nmap_Kd a.1001.png\n", &["a.1001.png"]);
    let names: Vec<_> = (0..4).map(|face| &shown(&scene, face).unwrap().0.name[..]).collect();
    assert_eq!((names, warnings.len()), (vec!["a.1001.png"; 4], 0));
}

/// The coordinates of faces tell their tiles, and `-s` and `-o` do not move them.
#[test]
fn options_do_not_move_tiles() {
    let (scene, warnings) = load("newmtl m\nmap_Kd -s 2 2 -o 1 0 a.<UDIM>.png\n", &["a.1001.png", "a.1002.png"]);
    let (image, at) = shown(&scene, 1).unwrap();
    assert_eq!((&image.name[..], at), ("a.1002.png", Vec2::new(0.0, 1.0)));
    assert!(warnings.iter().any(|warning| warning.contains("`-s` and `-o` of `map_Kd` are left out")), "{warnings:?}");
}

#[test]
fn faces_without_coordinates_count_as_faces_without_tiles() {
    let obj = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let image = png(|_, _| [9; 4]);
    let mtl = b"newmtl m\nmap_Kd a.<UDIM>.png\n";
    let (scene, warnings) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl), ("a.1001.png", &image)]);
    assert_eq!(of_face(&scene, 0).maps.base_colour, None);
    assert!(warnings.iter().any(|warning| warning.contains("1 triangles are in tiles")), "{warnings:?}");
}

#[test]
fn a_tile_in_another_case_is_taken_with_a_warning() {
    let (scene, warnings) = load("newmtl m\nmap_Kd A.<UDIM>.png\n", &["a.1001.png", "a.1002.png"]);
    assert_eq!(shown(&scene, 1).unwrap().0.name, "a.1002.png");
    assert!(warnings.iter().any(|warning| warning.contains("a.1001.png is taken")), "{warnings:?}");
}

/// A map without tiles is shown in all of them.
#[test]
fn maps_with_and_without_tiles_go_together() {
    let (scene, _) = load(
        "newmtl m\nmap_Kd -s 1 1 a.<UDIM>.png\nmap_Ks b.000.png\nmap_d a.<UDIM>.png\n",
        &["a.1001.png", "a.1002.png", "b.000.png"],
    );
    for face in 0..2 {
        let maps = &of_face(&scene, face).maps;
        let image = |map: &Option<kdray::scene::Texture>| map.as_ref().unwrap().image_ix;
        assert_eq!(image(&maps.base_colour), image(&maps.opacity), "{face}");
        assert_eq!(scene.images[image(&maps.specular) as usize].name, "b.000.png");
    }
    let maps = &of_face(&scene, 2).maps;
    assert!(maps.base_colour.is_none() && maps.opacity.is_none() && maps.specular.is_some());
}

#[test]
fn tiles_are_files_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let names = ["a.1001.png", "a.1002.png", "m.mtl", "m.obj"];
    names.iter().for_each(|name| std::fs::write(path(name), "").unwrap());
    std::fs::write(path("m.obj"), TILED).unwrap();
    std::fs::write(path("m.mtl"), "newmtl m\nmap_Kd a.<UDIM>.png\n").unwrap();
    assert_eq!(source_files(&path("m.obj")), names.map(path));
}

/// Many programs write the image of a leaf, and no `map_d`.
#[test]
fn images_of_colours_that_are_cut_out_have_holes() {
    let obj = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    let of = |mtl: &str, opacity: fn(u32) -> u8| {
        let mtl = format!("newmtl m\nmap_Kd a.png\n{mtl}\n");
        let image = png(|x, _| [40, 90, 20, opacity(x)]);
        let (scene, notes) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", &image)]);
        assert!(matches!(scene.images[0].pixels, Pixels::Bytes(_)));
        (scene.materials[0].clone(), notes)
    };
    let leaf = |x: u32| if x == 0 { 0 } else { 255 };
    let (material, notes) = of("", leaf);
    assert_eq!(material.alpha, Alpha::Mask(0.5));
    assert_eq!(material.maps.opacity.unwrap().channel, Channel::Alpha);
    assert!(notes.len() == 1 && notes[0].contains("`m`: the image of `map_Kd` is cut out by its opacity"), "{notes:?}");
    // A material in tiles is one material.
    let tiled = png(|x, _| [40, 90, 20, leaf(x)]);
    let mtl = b"newmtl m\nmap_Kd a.<UDIM>.png\n";
    let names = ["a.1001.png", "a.1002.png"].map(|name| (name, &tiled[..]));
    let (_, notes) = loaded(&[&[("m.obj", obj.as_bytes()), ("m.mtl", mtl)], &names[..]].concat());
    assert!(notes.iter().any(|note| note.contains("material `m`: the image")), "{notes:?}");
    // The opacity of microfacets is that of their base colour.
    let (material, _) = of("Pr 0.4", leaf);
    assert_eq!((material.alpha, material.maps.opacity), (Alpha::Mask(0.5), None));
    // A mask of another meaning has values in between. What the file states counts.
    for (mtl, opacity) in [("", (|x| 60 * x as u8) as fn(u32) -> u8), ("", |_| 0), ("d 0.5", leaf), ("illum 7", leaf)] {
        let (material, notes) = of(mtl, opacity);
        assert!(!matches!(material.alpha, Alpha::Mask(_)) && material.maps.opacity.is_none(), "{mtl}");
        assert!(notes.iter().all(|note| !note.contains("cut out")), "{notes:?}");
    }
}
