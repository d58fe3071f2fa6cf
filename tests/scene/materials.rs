//! Tests of the maps of materials, in MTL files and in scene files.

use std::{
    fs, io,
    path::Path,
    sync::{Arc, Mutex},
};

use glam::{Vec2, Vec3, Vec4};
use kdray::{
    layout::{MATERIAL_CONDUCTOR, MATERIAL_MICROFACET, MATERIAL_SINGLE_SCATTERING},
    scene::{
        Alpha, Channel, Clearcoat, Conductor, Encoding, Image, LoadOptions, Material, Pixels, Scene, SceneError, Sheen,
        Texture, Wrap,
    },
    world::FlatScene,
};

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

/// Returns a PNG file of 4 x 4 pixels.
pub fn png(pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_fn(4, 4, |x, y| image::Rgba(pixel(x, y)));
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Returns an HDR file of one pixel.
fn hdr() -> Vec<u8> {
    let mut bytes = io::Cursor::new(Vec::new());
    let image = image::DynamicImage::ImageRgb32F(image::Rgb32FImage::new(1, 1));
    image.write_to(&mut bytes, image::ImageFormat::Hdr).unwrap();
    bytes.into_inner()
}

fn grey(value: u8) -> Vec<u8> {
    png(|_, _| [value, value, value, 255])
}

/// Collects what is written.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes files to a folder, some of them below it, and loads the first one. Returns the warnings, too.
pub fn load_scene(files: &[(&str, &[u8])]) -> (Result<Scene, SceneError>, Vec<String>) {
    load_scene_with(files, &LoadOptions::default())
}

/// Does what [`load_scene`] does, with options.
pub fn load_scene_with(files: &[(&str, &[u8])], options: &LoadOptions) -> (Result<Scene, SceneError>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    let log = Log::default();
    let writer = log.clone();
    let subscriber =
        tracing_subscriber::fmt().with_ansi(false).without_time().with_writer(move || writer.clone()).finish();
    let path = folder.path().join(files[0].0);
    let scene = tracing::subscriber::with_default(subscriber, || Scene::load_with(&path, options));
    let text = String::from_utf8(log.0.lock().unwrap().clone()).unwrap();
    (scene, text.lines().map(str::to_owned).collect())
}

/// Loads a square with the material `m`. Returns the scene and the warnings.
fn load_mtl(mtl: &str, images: &[(&str, &[u8])]) -> (Scene, Vec<String>) {
    let obj = format!("mtllib m.mtl\nusemtl m\n{QUAD}");
    let mtl = format!("newmtl m\n{mtl}");
    let files = [&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())], images].concat();
    let (scene, warnings) = load_scene(&files);
    (scene.unwrap_or_else(|error| panic!("{error}\n{mtl}")), warnings)
}

/// Returns the material of [`load_mtl`], which must load without warnings.
fn material(mtl: &str, images: &[(&str, &[u8])]) -> Material {
    let (scene, warnings) = load_mtl(mtl, images);
    assert!(warnings.is_empty(), "{warnings:?}");
    scene.materials[0].clone()
}

fn first_pixel(image: &Image) -> [u8; 4] {
    let Pixels::Bytes(pixels) = &image.pixels else { panic!("bytes") };
    pixels[0]
}

#[test]
fn every_map_becomes_the_texture_of_its_term() {
    let mtl = "map_Kd a.png\nmap_Ks a.png\nmap_Ke b.png\nmap_d -imfchan g a.png\nmap_Ns b.png\nnorm -bm 0.5 b.png\n";
    let (scene, warnings) = load_mtl(mtl, &[("a.png", &grey(10)), ("b.png", &grey(20))]);
    assert!(warnings.is_empty(), "{warnings:?}");
    let m = &scene.materials[0];
    assert_eq!(scene.images.iter().map(|image| first_pixel(image)[0]).collect::<Vec<_>>(), [10, 20]);
    assert_eq!(m.maps.base_colour, Some(Texture::of_image(0)));
    assert_eq!(m.maps.specular, Some(Texture::of_image(0)));
    assert_eq!(m.maps.emission, Some(Texture::of_image(1)));
    assert_eq!(m.maps.opacity, Some(Texture::of_data(0, Channel::Green)));
    assert_eq!(m.maps.roughness, Some(Texture::of_data(1, Channel::Luminance)));
    assert_eq!(m.maps.normal, Some(Texture::of_data(1, Channel::Red)));
    assert_eq!((m.maps.normal_scale, m.microfacet), (0.5, None));
    // What the maps alone state is white.
    assert_eq!((m.kd, m.ka, m.ks, m.ke), (Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::ONE));
    assert_eq!(material("map_Kd a.png\nKd 0.5", &[("a.png", &grey(1))]).kd, Vec3::splat(0.5));
    // The square has the tangents that its normal map needs.
    assert_eq!(scene.meshes[0].tangents, [[Vec4::new(1.0, 0.0, 0.0, 1.0); 3]; 2]);
}

#[test]
fn options_place_the_image() {
    let m = material("map_Kd -s 2 4 1 -o 0.25 0.5 -clamp on  my image.png", &[("my image.png", &grey(1))]);
    let texture = m.maps.base_colour.unwrap();
    assert_eq!(texture.transform.transform_point2(Vec2::new(0.0, 1.0)), Vec2::new(0.25, 0.5));
    assert_eq!(texture.transform.transform_point2(Vec2::new(1.0, 0.0)), Vec2::new(2.25, -3.5));
    assert_eq!((texture.wrap, texture.encoding), ([Wrap::Clamp; 2], Encoding::Srgb));
}

#[test]
fn physically_based_terms_make_microfacets() {
    let files: [(&str, &[u8]); 1] = [("r.png", &grey(128))];
    let mtl = "Kd 1 0 0\nPr 0.25\nPm 1\nPs 0.5\nPc 1\nPcr 0.125\nNi 1.4\naniso 0.5\nanisor 0\nnewmtl n\nPc 1";
    let (scene, warnings) = load_mtl(mtl, &files);
    // Each term is told once, and none of its value 0.
    let by_whitted = "is not shown by the integrator whitted";
    let terms = [("m.mtl:5: `Ps`", by_whitted), ("m.mtl:6: `Pc`", by_whitted), ("m.mtl:9: `aniso`", "is not shown")];
    for (warning, (term, what)) in warnings.iter().zip(terms) {
        assert!(warning.ends_with(&format!("{term} {what}")), "{warnings:?}");
    }
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    material("Ps 0\nPc 0\nPcr 0.03\naniso 0\nanisor 0", &files);
    let m = &scene.materials[0];
    let pbr = m.microfacet.unwrap();
    assert_eq!((pbr.roughness, pbr.metallic, m.kd, m.ks, m.ni), (0.25, 1.0, Vec3::X, Vec3::ONE, 1.4));
    assert_eq!((m.sheen.colour, m.clearcoat.factor, m.clearcoat.roughness), (Vec3::splat(0.5), 1.0, 0.125));
    assert_eq!(material("Pm 1", &files).microfacet.unwrap().roughness, 0.5);
    let m = material("map_Pr r.png\nmap_Pm -imfchan b r.png", &files);
    assert_eq!((m.microfacet.unwrap().roughness, m.microfacet.unwrap().metallic), (1.0, 1.0));
    assert_eq!(m.maps.roughness, Some(Texture::of_data(0, Channel::Luminance)));
    assert_eq!(m.maps.metallic, Some(Texture::of_data(0, Channel::Blue)));
    assert_eq!(m.alpha, Alpha::Opaque);
    assert_eq!(material("Pr 2", &files).microfacet.unwrap().roughness, 1.0);
}

#[test]
fn opacity_is_in_alpha_or_in_the_colour() {
    let holes = png(|x, _| [9, 9, 9, if x < 2 { 0 } else { 255 }]);
    let m = material("map_d a.png", &[("a.png", &holes)]);
    assert_eq!((m.maps.opacity.unwrap().channel, m.alpha), (Channel::Alpha, Alpha::Mask(0.5)));
    let black_and_white = png(|x, _| if x < 2 { [0, 0, 0, 255] } else { [255; 4] });
    let m = material("map_d a.png", &[("a.png", &black_and_white)]);
    assert_eq!((m.maps.opacity.unwrap().channel, m.alpha), (Channel::Luminance, Alpha::Mask(0.5)));
    let m = material("map_d a.png", &[("a.png", &grey(100))]);
    assert_eq!((m.maps.opacity.unwrap().channel, m.alpha), (Channel::Luminance, Alpha::Blend));
    assert_eq!(material("d 0.5\nmap_d a.png", &[("a.png", &holes)]).alpha, Alpha::Blend);
    let (scene, _) = load_mtl("map_Tr a.png", &[("a.png", &grey(100))]);
    // Transparency becomes opacity, whichever channel holds it.
    assert_eq!(first_pixel(&scene.images[0]), [155, 155, 155, 0]);
    let (scene, _) = load_mtl("map_Tr -imfchan m a.png", &[("a.png", &png(|_, _| [9, 9, 9, 100]))]);
    let map = scene.materials[0].maps.opacity.as_ref().expect("a map");
    assert_eq!((map.channel, first_pixel(&scene.images[0])[3]), (Channel::Alpha, 155));
    // The base colour of microfacets brings the opacity of its image along.
    let m = material("Pr 1\nmap_Kd a.png\nmap_d a.png", &[("a.png", &holes)]);
    assert_eq!((m.maps.opacity, m.alpha), (None, Alpha::Mask(0.5)));
}

#[test]
fn bump_maps_are_heights_or_normals() {
    for (keyword, pixel, is_plain) in [("bump", [128, 128, 255, 255], true), ("map_Bump", [90, 90, 90, 255], false)] {
        let (scene, warnings) = load_mtl(&format!("{keyword} -bm 2 a.png"), &[("a.png", &png(|_, _| pixel))]);
        assert!(warnings.is_empty(), "{warnings:?}");
        let [r, g, b, _] = first_pixel(&scene.images[0]);
        // The normal map of a plane is blue.
        assert!(r.abs_diff(128) <= 1 && g.abs_diff(128) <= 1 && b == 255, "{r} {g} {b}");
        assert_eq!(scene.materials[0].maps.normal_scale, if is_plain { 2.0 } else { 1.0 });
        assert_eq!(scene.images.len(), 1);
    }
    // A ramp that rises along x tilts normals against x. The two factors make two images.
    let ramp = png(|x, _| [x as u8 * 40; 4].map(|c| c | 1));
    let (scene, _) = load_mtl("bump -bm 1 a.png\nnewmtl n\nbump -bm 4 a.png", &[("a.png", &ramp)]);
    let red = |ix: usize| match &scene.images[ix].pixels {
        Pixels::Bytes(pixels) => pixels[1][0],
        Pixels::Halves(_) => panic!("bytes"),
    };
    assert!(red(1) < red(0) && red(0) < 127, "{} {}", red(0), red(1));
}

#[test]
fn images_are_found_where_files_name_them() {
    let image = grey(7);
    let obj = format!("mtllib deep/m.mtl\nusemtl m\n{QUAD}");
    for (name, n_warnings) in
        [("../Maps/a.png", 0), ("..\\Maps\\a.png", 0), ("../maps/A.PNG", 1), ("C:\\x\\b.png", 0), ("\"b.png\"", 0)]
    {
        let mtl = format!("newmtl m\nmap_Kd {name}\n");
        let files: [(&str, &[u8]); 4] =
            [("m.obj", obj.as_bytes()), ("deep/m.mtl", mtl.as_bytes()), ("Maps/a.png", &image), ("deep/b.png", &image)];
        let (scene, warnings) = load_scene(&files);
        assert_eq!(scene.unwrap().images.len(), 1, "{name}");
        assert_eq!(warnings.len(), n_warnings, "{name}: {warnings:?}");
    }
}

#[test]
fn what_is_not_shown_is_told_once() {
    let broken: [(&str, &[u8]); 1] = [("broken.png", b"no image")];
    for (mtl, what) in [
        ("map_Kd none.png\nmap_Ks none.png", "m.mtl:2: the image is not shown"),
        ("map_Kd broken.png", "m.mtl:2: the image is not shown"),
        ("map_Kd ../x.png", "m.mtl:2: `map_Kd` is not shown: `../x.png` leaves the folder"),
        ("map_Kd", "m.mtl:2: `map_Kd` is not shown: names no file"),
        ("map_Kd -s x.png", "m.mtl:2: `map_Kd` is not shown: -s"),
        ("map_d -imfchan z broken.png", "m.mtl:2: `map_d` is not shown: -imfchan z"),
        ("\nrefl -type sphere x.png\nrefl y.png", "m.mtl:3: `refl` is not shown"),
        ("disp x.png", "m.mtl:2: `disp` is not shown"),
        ("map_Ka x.png", "m.mtl:2: `map_Ka` is not shown"),
    ] {
        let (scene, warnings) = load_mtl(mtl, &broken);
        assert_eq!(warnings.len(), 1, "{mtl}: {warnings:?}");
        assert!(warnings[0].contains(what), "{mtl}: {warnings:?}");
        let m = &scene.materials[0];
        assert_eq!((m.kd, m.maps.textures().count(), scene.images.len()), (Vec3::splat(0.8), 0, 0), "{mtl}");
    }
    // A library that leaves the folder is no reason to show nothing.
    let leaving = ["/etc/passwd", "../x.mtl", "a\\..\\..\\x.mtl", "c:x.mtl"];
    for name in leaving {
        let obj = format!("mtllib {name}\n{QUAD}");
        let (scene, warnings) = load_scene(&[("m.obj", obj.as_bytes())]);
        assert_eq!(scene.unwrap().n_triangles(), 2);
        assert!(warnings.len() == 1 && warnings[0].contains("leaves the folder"), "{warnings:?}");
    }
}

#[test]
fn names_in_the_wrong_case_are_taken() {
    let obj = format!("mtllib M.MTL\nusemtl Leaf\n{QUAD}usemtl twin\nf 1 2 3\nusemtl two\nf 1 2 4\n");
    let mtl = b"newmtl leaf\nKd 0 1 0\nnewmtl Twin\nnewmtl TWIN\nnewmtl Two\nnewmtl two\n";
    let (scene, warnings) = load_scene(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl)]);
    let scene = scene.unwrap();
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    let used: Vec<&str> =
        scene.meshes[0].slots.iter().map(|slot| names[scene.instances[0].materials[*slot as usize] as usize]).collect();
    assert_eq!(used, ["leaf", "leaf", "(default)", "two"]);
    for what in ["m.mtl is taken", "`Leaf`: `leaf` is taken", "no library defines material `twin`"] {
        assert_eq!(warnings.iter().filter(|warning| warning.contains(what)).count(), 1, "{what}: {warnings:?}");
    }
    assert_eq!(warnings.len(), 3);
}

#[test]
fn hostile_mtl_lines_are_no_trouble() {
    let options =
        ["-s", "-o", "-t", "-bm", "-imfchan", "-clamp", "-mm", "-texres", "-type", "-", "--", "\"", "\\", "nan"];
    let keywords = ["map_Kd", "map_d", "bump", "norm", "map_Pr", "refl", "map_Tr"];
    let image = grey(3);
    for keyword in keywords {
        for a in options {
            for b in ["", "1", "1e39", "a.png", "../../..", "\u{0}", "é", "on"] {
                load_mtl(&format!("{keyword} {a} {b} a.png\n{keyword} {a} {b}\n"), &[("a.png", &image)]);
            }
        }
    }
}

/// Loads a plane with a material of a scene file.
fn load_toml(material: &str, images: &[(&str, &[u8])]) -> Result<Scene, SceneError> {
    let toml =
        format!("materials.m = {{ {material} }}\n[[mesh]]\ngenerator = 'plane'\nsize = [2, 2]\nmaterial = 'm'\n");
    load_scene(&[&[("s.toml", toml.as_bytes())], images].concat()).0
}

#[test]
fn scene_files_describe_coats_and_conductors() {
    let text = "clearcoat = 0.5, clearcoat_roughness = 0.25, sheen_color = [0.1, 0.2, 2], sheen_roughness = 0.75, \
                conductor_eta = [0.2, 1, 2], conductor_k = [4, 0, 1], single_scattering = true";
    let scene = load_toml(text, &[]).unwrap();
    let m = &scene.materials[0];
    let pbr = m.microfacet.unwrap();
    let (eta, k) = (Vec3::new(0.2, 1.0, 2.0), Vec3::new(4.0, 0.0, 1.0));
    assert_eq!((pbr.conductor, pbr.metallic, pbr.has_single_scattering), (Some(Conductor { eta, k }), 1.0, true));
    assert_eq!(m.clearcoat, Clearcoat { factor: 0.5, roughness: 0.25 });
    assert_eq!(m.sheen, Sheen { colour: Vec3::new(0.1, 0.2, 1.0), roughness: 0.75 });
    // The base colour is the reflectance along the normal: ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
    let reflectance = Vec3::new(16.64 / 17.44, 0.0, 2.0 / 10.0);
    assert!((m.kd - reflectance).abs().max_element() < 1e-6, "{}", m.kd);
    let flat = FlatScene::new(&scene).unwrap().materials[0];
    let flags = MATERIAL_MICROFACET | MATERIAL_CONDUCTOR | MATERIAL_SINGLE_SCATTERING;
    assert_eq!((flat.flags, flat.conductor_eta, flat.conductor_k), (flags, eta, k));
    assert_eq!((flat.clearcoat, flat.clearcoat_roughness), (0.5, 0.25));
    assert_eq!((flat.sheen_colour, flat.sheen_roughness), (m.sheen.colour, 0.75));
    let terms: Vec<_> = m.terms().into_iter().filter(|term| !term.is_default).map(|term| term.key).collect();
    let keys = ["clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness", "single_scattering"];
    let missing: Vec<_> =
        keys.iter().chain(&["conductor_eta", "conductor_k"]).filter(|key| !terms.contains(key)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn scene_files_describe_maps_and_microfacets() {
    let images: [(&str, &[u8]); 2] = [("maps/a.png", &grey(1)), ("b.png", &png(|x, _| [x as u8 * 60; 4]))];
    let text = "map_Kd = 'maps/a.png', metallic = 0.5, roughness = 0.25, transmission = 1, Ni = 1.33, cutoff = 0.25, \
                attenuation_color = [0.5, 1, 1], attenuation_distance = 2, map_d = 'b.png', normal_scale = 2, \
                map_normal = { file = 'b.png', scale = [2, 3], offset = [0.5, 0], wrap = 'mirror', filter = 'nearest' \
                }, map_roughness = { file = 'b.png', channel = 'green', encoding = 'srgb' }, \
                map_occlusion = 'maps/a.png'";
    let scene = load_toml(text, &images).unwrap();
    let m = &scene.materials[0];
    let pbr = m.microfacet.unwrap();
    assert_eq!((pbr.metallic, pbr.roughness, pbr.transmission, pbr.is_solid), (0.5, 0.25, 1.0, true));
    assert_eq!((pbr.attenuation_colour, pbr.attenuation_distance), (Vec3::new(0.5, 1.0, 1.0), 2.0));
    assert_eq!((m.kd, m.ks, m.ni, m.alpha), (Vec3::ONE, Vec3::ONE, 1.33, Alpha::Mask(0.25)));
    assert_eq!(m.maps.base_colour, Some(Texture::of_image(0)));
    assert_eq!(m.maps.opacity, Some(Texture::of_data(1, Channel::Alpha)));
    assert_eq!(m.maps.occlusion, Some(Texture::of_data(0, Channel::Luminance)));
    let roughness = Texture { encoding: Encoding::Srgb, ..Texture::of_data(1, Channel::Green) };
    assert_eq!(m.maps.roughness, Some(roughness));
    let normal = m.maps.normal.as_ref().unwrap();
    assert_eq!(normal.transform.transform_point2(Vec2::ONE), Vec2::new(2.5, 3.0));
    assert_eq!((normal.wrap, normal.is_smooth, m.maps.normal_scale), ([Wrap::Mirror; 2], false, 2.0));
    // On the plane, u is along +x and decreasing v along -z.
    assert_eq!(scene.meshes[0].tangents, [[Vec4::new(1.0, 0.0, 0.0, 1.0); 3]; 2]);
    assert!(!load_toml("transmission = 1, thin = true", &[]).unwrap().materials[0].microfacet.unwrap().is_solid);
    assert!(load_toml("unlit = true", &[]).unwrap().materials[0].is_unlit);
    let plain = load_toml("Kd = [1, 1, 1]", &[]).unwrap();
    assert!(plain.materials[0].microfacet.is_none() && plain.meshes[0].uvs[0].is_empty());
}

#[test]
fn mistakes_in_materials_are_named() {
    let image: [(&str, &[u8]); 2] = [("a.png", &grey(1)), ("a.hdr", &hdr())];
    for (text, what) in [
        ("map_Kd = 'none.png'", "material `m`: map_Kd: "),
        ("map_Kd = 3", "expected the name of an image, or a table"),
        ("map_Kd = { file = 'a.png', wrap = 'often' }", "expected the name of an image, or a table"),
        ("map_Kd = { file = 'a.png', scale = [nan, 1] }", "map_Kd: scale is not finite"),
        ("map_kd = 'a.png'", "unknown field `map_kd`"),
        ("metallic = 2", "metallic = 2 is outside 0 to 1"),
        ("clearcoat = 1.5", "clearcoat = 1.5 is outside 0 to 1"),
        ("sheen_color = [0, -1, 0]", "sheen_color = [0.0, -1.0, 0.0] is not a colour"),
        ("sheen_roughness = 2", "sheen_roughness = 2 is outside 0 to 1"),
        ("conductor_eta = [1, 1, 1]", "has conductor_eta and no conductor_k"),
        ("conductor_k = [1, 1, 1]", "has conductor_k and no conductor_eta"),
        ("conductor_eta = [1, 0, 1], conductor_k = [1, 1, 1]", "conductor_eta = 0 is outside 0.001 to 100"),
        ("clearcoat = 1, Ks = [1, 1, 1]", "has Ks beside clearcoat"),
        ("roughness = 0.5, Ns = 3", "has Ns beside roughness"),
        ("map_metallic = 'a.png', illum = 3", "has illum beside map_metallic"),
        ("attenuation_distance = 0", "attenuation_distance = 0 is not above 0"),
        ("cutoff = -1", "cutoff = -1 is outside"),
        ("normal_scale = 1", "normal_scale and no map_normal"),
        ("map_Kd = { file = 'a.png', channel = 'red' }", "map_Kd: has `channel`"),
        ("map_normal = { file = 'a.png', channel = 'green' }", "map_normal: has `channel`"),
        ("map_d = { file = 'a.png', channel = 'alpha', encoding = 'srgb' }", "map_d: has `encoding`"),
        ("map_Kd = { file = 'a.hdr', encoding = 'srgb' }", "map_Kd: has `encoding = \"srgb\"`"),
    ] {
        let error = load_toml(text, &image).map(|scene| scene.materials).expect_err(text).to_string();
        assert!(error.contains("s.toml:1: ") && error.contains(what) && error.lines().count() == 1, "{text}: {error}");
    }
}

#[test]
fn meshes_from_files_are_scaled_and_have_images_of_their_own() {
    let obj = format!("mtllib m.mtl\nusemtl m\n{QUAD}");
    let toml = "materials.m = { map_Kd = 'a.png' }\n[[mesh]]\ngenerator = 'box'\nsize = [1, 1, 1]\nmaterial = 'm'\n\
                uv_scale = [2, 3]\n[[mesh]]\nfile = 'm.obj'\n[[mesh]]\nfile = 'm.obj'\nmaterial = 'm'\n";
    let files: [(&str, &[u8]); 5] = [
        ("s.toml", toml.as_bytes()),
        ("m.obj", obj.as_bytes()),
        ("m.mtl", b"newmtl m\nmap_Kd b.png\n"),
        ("a.png", &grey(1)),
        ("b.png", &grey(2)),
    ];
    let scene = load_scene(&files).0.unwrap();
    assert_eq!(scene.meshes[0].uvs[0][0], [Vec2::new(0.0, 3.0), Vec2::new(2.0, 3.0), Vec2::new(2.0, 0.0)]);
    let colour_of = |instance: usize| {
        let material = &scene.materials[scene.instances[instance].materials[0] as usize];
        first_pixel(&scene.images[material.maps.base_colour.as_ref().unwrap().image_ix as usize])[0]
    };
    assert_eq!([0, 1, 2].map(colour_of), [1, 2, 1]);
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    let names: Vec<String> = kdray::scene::source_files(&folder.path().join("s.toml"))
        .iter()
        .map(|path: &std::path::PathBuf| Path::new(path).file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(names, ["a.png", "b.png", "m.mtl", "m.obj", "s.toml"]);
}
