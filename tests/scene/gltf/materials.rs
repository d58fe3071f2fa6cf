//! Materials, textures and images of glTF files.

use std::{fs, io::Cursor};

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{Affine2, Vec2, Vec3, Vec4};
use kdray::scene::{Alpha, Channel, Clearcoat, Encoding, Material, Microfacet, Pixels, Scene, Sheen, Texture, Wrap};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{F32, Model};

/// A square in the plane z = 0 that faces +z, whose texture coordinates are those of an image that stands upright.
fn square() -> Model {
    let mut model = Model::new();
    let positions = model.accessor("VEC3", F32, &[0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let uvs = model.accessor("VEC2", F32, &[0.0_f32, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    model.show(json!({ "attributes": attributes, "mode": 5, "material": 0 }));
    model
}

fn png(rgba: [u8; 4]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(2, 1, image::Rgba(rgba)).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A square with a material and a texture with an image of 2 x 1 red pixels.
fn with_material(material: Value) -> Model {
    let mut model = square();
    model.push("materials", material);
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(png([255, 0, 0, 255])));
    model.push("images", json!({ "uri": uri, "name": "red" }));
    model.push("textures", json!({ "source": 0 }));
    model
}

fn material(json: Value) -> Material {
    with_material(json).scene().materials.remove(0)
}

#[test]
fn the_default_material_is_white_metal() {
    let found = material(json!({}));
    assert_eq!((found.kd, found.ka, found.ks, found.ke), (Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::ZERO));
    assert_eq!((found.d, found.ni, found.alpha), (1.0, 1.5, Alpha::Opaque));
    assert_eq!((found.is_unlit, found.is_double_sided), (false, false));
    let expected = Microfacet { metallic: 1.0, ..Microfacet::default() };
    assert_eq!(found.microfacet, Some(expected));
    let mut model = with_material(json!({}));
    model.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let unnamed = model.scene().materials.remove(0);
    assert_eq!(unnamed, Material { name: "(default of glTF)".to_owned(), ..found });
}

#[test]
fn every_term_is_read() {
    let found = material(json!({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5,
            "roughnessFactor": 0.6 },
        "extensions": {
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.1 },
            "KHR_materials_emissive_strength": { "emissiveStrength": 4 },
            "KHR_materials_ior": { "ior": 1.3 },
            "KHR_materials_sheen": { "sheenColorFactor": [0.1, 0.5, 1], "sheenRoughnessFactor": 0.3 },
            "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2] },
            "KHR_materials_transmission": { "transmissionFactor": 0.8 },
            "KHR_materials_volume": {
                "thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [0.9, 0.8, 0.7],
            },
        },
    }));
    assert_eq!((found.name.as_str(), found.is_double_sided), ("all", true));
    assert_eq!((found.kd, found.d, found.alpha), (Vec3::new(0.1, 0.2, 0.3), 0.4, Alpha::Mask(0.25)));
    assert_eq!((found.ke, found.ks, found.ni), (Vec3::new(4.0, 2.0, 0.0), Vec3::new(0.5, 0.25, 1.0), 1.3));
    let expected = Microfacet {
        metallic: 0.5,
        roughness: 0.6,
        transmission: 0.8,
        is_solid: true,
        attenuation_colour: Vec3::new(0.9, 0.8, 0.7),
        attenuation_distance: 2.0,
        conductor: None,
        has_single_scattering: false,
    };
    assert_eq!(found.microfacet, Some(expected));
    assert_eq!(found.clearcoat, Clearcoat { factor: 0.7, roughness: 0.1 });
    assert_eq!(found.sheen, Sheen { colour: Vec3::new(0.1, 0.5, 1.0), roughness: 0.3 });
    let blend = material(json!({ "alphaMode": "BLEND", "extensions": { "KHR_materials_unlit": {} } }));
    assert_eq!((blend.alpha, blend.is_unlit), (Alpha::Blend, true));
    let solid =
        |volume: Value| material(json!({ "extensions": { "KHR_materials_volume": volume } })).microfacet.unwrap();
    assert!(!solid(json!({})).is_solid && solid(json!({})).attenuation_distance == f32::INFINITY);
    // Index 0 stands for a perfect reflector.
    assert_eq!(material(json!({ "extensions": { "KHR_materials_ior": { "ior": 0 } } })).ni, 100.0);
}

#[test]
fn every_texture_is_read() {
    let all = material(json!({
        "normalTexture": { "index": 0, "scale": 0.5 }, "occlusionTexture": { "index": 0, "strength": 0.25 },
        "emissiveTexture": { "index": 0 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } },
        "extensions": {
            "KHR_materials_specular": { "specularTexture": { "index": 0 }, "specularColorTexture": { "index": 0 } },
            "KHR_materials_transmission": { "transmissionTexture": { "index": 0 } },
        },
    }));
    let (colour, data) = (Texture::of_image(0), |channel| Some(Texture::of_data(0, channel)));
    assert_eq!(colour.encoding, Encoding::Srgb);
    let maps = all.maps;
    for found in [maps.base_colour, maps.emission, maps.specular] {
        assert_eq!(found, Some(colour.clone()));
    }
    assert_eq!(maps.roughness, data(Channel::Green));
    assert_eq!(maps.metallic, data(Channel::Blue));
    assert_eq!(maps.specular_factor, data(Channel::Alpha));
    assert_eq!(maps.transmission, data(Channel::Red));
    assert_eq!((maps.occlusion, maps.occlusion_strength), (data(Channel::Red), 0.25));
    assert_eq!((maps.normal.map(|normal| normal.encoding), maps.normal_scale), (Some(Encoding::Linear), 0.5));
    assert_eq!(maps.opacity, None);
}

/// Returns the base colour's texture of a material whose reference to it, texture and sampler are given.
fn base_colour(info: Value, sampler: Value) -> Texture {
    let mut model = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": info } }));
    model.push("samplers", sampler);
    model.json["textures"][0]["sampler"] = json!(0);
    model.scene().materials.remove(0).maps.base_colour.unwrap()
}

#[test]
fn samplers_and_transforms_are_read() {
    let plain = base_colour(json!({ "index": 0, "texCoord": 1 }), json!({}));
    assert_eq!((plain.wrap, plain.is_smooth, plain.uv_set), ([Wrap::Repeat; 2], true, 1));
    let sampler = json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987 });
    let placed = |transform: Value| {
        let extensions = json!({ "KHR_texture_transform": transform });
        base_colour(json!({ "index": 0, "texCoord": 1, "extensions": extensions }), sampler.clone())
    };
    let found = placed(json!({ "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 4] }));
    assert_eq!((found.wrap, found.is_smooth, found.uv_set), ([Wrap::Clamp, Wrap::Mirror], false, 1));
    // The coordinates (1, 0) are scaled to (2, 0), turn counter-clockwise in the image, thus to (0, -2), and move.
    for (uv, expected) in [([0.0, 0.0], [0.5, 0.25]), ([1.0, 0.0], [0.5, -1.75]), ([0.0, 1.0], [4.5, 0.25])] {
        let moved = found.transform.transform_point2(Vec2::from_array(uv));
        assert!(moved.distance(Vec2::from_array(expected)) < 1e-5, "{uv:?} moves to {moved}");
    }
    assert_eq!(placed(json!({ "texCoord": 0 })).uv_set, 0);
    assert_eq!(placed(json!({ "texCoord": 3 })).uv_set, 0);
    assert_eq!(placed(json!({})).transform, Affine2::IDENTITY);
    let normal =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0], "texCoord": 1 } } });
    let maps = material(json!({ "normalTexture": normal, "occlusionTexture": normal })).maps;
    for texture in [maps.normal, maps.occlusion] {
        let texture = texture.unwrap();
        assert_eq!((texture.uv_set, texture.transform.translation), (1, Vec2::new(0.5, 0.0)));
    }
}

#[test]
fn images_come_from_files_views_and_uris() {
    let textured = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } });
    let red = Pixels::Bytes(vec![[255, 0, 0, 255]; 2]);
    let model = with_material(textured);
    let scene = model.scene();
    assert_eq!((scene.images.len(), &scene.images[0].pixels), (1, &red));
    assert_eq!((scene.images[0].name.as_str(), scene.images[0].width, scene.images[0].height), ("red", 2, 1));
    let mut in_view = model.clone();
    let view = in_view.view(&png([255, 0, 0, 255]));
    in_view.json["images"][0] = json!({ "bufferView": view, "mimeType": "image/png" });
    assert_eq!(in_view.scene().images[0].pixels, red);
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("a b.png"), png([255, 0, 0, 255])).unwrap();
    let load = |model: &Model| {
        let path = folder.path().join("x.glb");
        fs::write(&path, model.glb()).unwrap();
        Scene::load(&path).map_err(|error| error.to_string())
    };
    let mut external = model.clone();
    external.json["images"][0] = json!({ "uri": "a%20b.png" });
    assert_eq!(load(&external).unwrap().images[0].pixels, red);
    // Without the image, the material is shown without it.
    external.json["images"][0] = json!({ "uri": "none.png" });
    let scene = load(&external).unwrap();
    assert_eq!((scene.images.len(), &scene.materials[0].maps.base_colour), (0, &None));
    external.json["images"][0] = json!({ "uri": "../a.png" });
    assert!(load(&external).unwrap().images.is_empty());
    external.json["images"][0] = json!({});
    assert!(load(&external).unwrap().images.is_empty());
}

/// Files have such an image for readers that do not know the further format.
#[test]
fn an_image_of_a_further_format_that_cannot_be_read_has_another_beside_it() {
    for junk in ["data:,junk", "none.ktx2", "data:;base64,*"] {
        let mut model = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
        model.push("images", json!({ "uri": junk }));
        model.json["textures"][0]["extensions"] = json!({ "KHR_texture_basisu": { "source": 1 } });
        let scene = model.scene();
        assert_eq!((scene.images.len(), &*scene.images[0].name), (1, "red"), "{junk}");
    }
}

#[test]
fn images_that_cannot_be_decoded_are_left_out() {
    let pbr = json!({ "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 1 } });
    let mut model = with_material(json!({ "pbrMetallicRoughness": pbr, "emissiveTexture": { "index": 2 } }));
    let good = model.json["images"][0].clone();
    model.json["images"] = json!([{ "uri": "data:,junk" }, good, { "uri": "none.png" }]);
    model.push("textures", json!({ "source": 1 }));
    // A texture without an image of its own.
    model.push("textures", json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } }));
    let scene = model.scene();
    let maps = &scene.materials[0].maps;
    assert_eq!((scene.images.len(), maps.base_colour.is_none(), maps.emission.is_none()), (1, true, true));
    assert_eq!(maps.roughness.as_ref().map(|texture| texture.image_ix), Some(0));
    // Images that no shown material uses are not read.
    model.json["images"][2] = json!({ "uri": "../../etc/passwd" });
    model.scene();
    model.json["textures"][2] = json!({ "source": 0, "extensions": { "EXT_texture_webp": { "source": 1 } } });
    assert!(model.scene().materials[0].maps.emission.is_some());
}

#[test]
fn tangents_follow_the_texture_coordinates() {
    let normal_map = json!({ "normalTexture": { "index": 0 } });
    let model = with_material(normal_map.clone());
    let [along, mirrored] = [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(-1.0, 0.0, 0.0, -1.0)];
    assert_eq!(model.scene().meshes[0].tangents, [[along; 3]; 2]);
    // Coordinates that are mirrored along u.
    let mut turned = model.clone();
    let uvs = turned.accessor("VEC2", F32, &[1.0_f32, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    turned.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    assert_eq!(turned.scene().meshes[0].tangents, [[mirrored; 3]; 2]);
    // No normal map, no texture coordinates.
    assert!(with_material(json!({})).scene().meshes[0].tangents.is_empty());
    let mut bare = model;
    bare.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    assert!(bare.scene().meshes[0].tangents.is_empty());
}

/// A scene file replaces a model's material by one with a normal map, and mirrors its coordinates.
#[test]
fn tangents_follow_the_material_that_counts() {
    let load = |table: &str, model: &Model| {
        let folder = TempDir::new().unwrap();
        let toml = format!(
            "[materials.m]\nmap_normal = {{ file = 'a.png', scale = [-1, 1] }}\n[[mesh]]\nfile = 'm.glb'\n{table}\n"
        );
        let files = [("s.toml", toml.as_bytes()), ("m.glb", &model.glb()), ("a.png", &png([128, 128, 255, 255]))];
        for (name, bytes) in files {
            fs::write(folder.path().join(name), bytes).unwrap();
        }
        Scene::load(&folder.path().join("s.toml")).unwrap().meshes[0].tangents.clone()
    };
    let [along, against] = [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(-1.0, 0.0, 0.0, -1.0)];
    let named = with_material(json!({ "name": "m" }));
    assert!(load("", &named).is_empty());
    for table in ["material = 'm'", "override = true"] {
        assert_eq!(load(table, &named), [[against; 3]; 2], "{table}");
        assert_eq!(load(&format!("{table}\nuv_scale = [-3, 2]"), &named), [[along; 3]; 2], "{table}");
    }
    // The file's own tangents and their sides follow the texture coordinates.
    let mut own = named;
    let tangents = own.accessor("VEC4", F32, &[[0.0_f32, 1.0, 0.0, 1.0]; 4].concat());
    let normals = own.accessor("VEC3", F32, &[[0.0_f32, 0.0, 1.0]; 4].concat());
    let attributes = &mut own.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["TANGENT"], attributes["NORMAL"]) = (json!(tangents), json!(normals));
    assert_eq!(load("material = 'm'", &own), [[Vec4::new(0.0, 1.0, 0.0, 1.0); 3]; 2]);
    assert_eq!(load("uv_scale = [-1, 1]", &own), [[Vec4::new(0.0, -1.0, 0.0, -1.0); 3]; 2]);
    assert_eq!(load("uv_scale = [1, -1]", &own), [[Vec4::new(0.0, 1.0, 0.0, -1.0); 3]; 2]);
}

/// In a fan of very many triangles around one point, each has the tangent of its own plane, since MikkTSpace would
/// recur too deeply. Faces without area take no time.
#[test]
fn large_fans_do_not_exhaust_the_stack() {
    let n = 200_000;
    let mut model = with_material(json!({ "normalTexture": { "index": 0 } }));
    let circle = (0..n).map(|ix| Vec2::from_angle(ix as f32 / n as f32 * std::f32::consts::TAU));
    let mut points: Vec<_> = std::iter::once(Vec2::ZERO).chain(circle).collect();
    points.resize(2 * n, Vec2::X);
    let positions: Vec<_> = points.iter().flat_map(|p| [p.x, p.y, 0.0]).collect();
    let uvs: Vec<_> = points.iter().flat_map(|p| p.to_array()).collect();
    let (positions, uvs) = (model.accessor("VEC3", F32, &positions), model.accessor("VEC2", F32, &uvs));
    let primitive = &mut model.json["meshes"][0]["primitives"][0];
    primitive["attributes"] = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    primitive["mode"] = json!(6);
    let scene = model.scene();
    let tangents = &scene.meshes[0].tangents;
    // v grows along y.
    let is_along_x = |tangent: &Vec4| tangent.distance(Vec4::new(1.0, 0.0, 0.0, -1.0)) < 0.05;
    assert!(tangents[..n - 1].as_flattened().iter().all(is_along_x));
    assert_eq!(tangents[n + 1..], vec![[Vec4::ZERO; 3]; n - 3]);
}

#[test]
fn terms_out_of_range_are_told() {
    for (json, what) in [
        (json!({ "pbrMetallicRoughness": { "metallicFactor": 2 } }), "metallicFactor = 2"),
        (json!({ "pbrMetallicRoughness": { "roughnessFactor": -1 } }), "roughnessFactor = -1"),
        (json!({ "pbrMetallicRoughness": { "baseColorFactor": [-1, 0, 0, 1] } }), "baseColorFactor"),
        (json!({ "emissiveFactor": [-1, 0, 0] }), "emissiveFactor"),
        (json!({ "alphaMode": "GLASS" }), "alphaMode: `GLASS` (`OPAQUE` is taken)"),
        (json!({ "normalTexture": { "index": 9 } }), "normalTexture: there is no textures[9]"),
        (json!({ "occlusionTexture": { "index": 0, "strength": 2 } }), "occlusionTexture.strength = 2"),
        (json!({ "extensions": { "KHR_materials_ior": { "ior": 0.5 } } }), "ior = 0.5"),
        (json!({ "extensions": { "KHR_materials_volume": { "attenuationDistance": 0 } } }), "attenuationDistance = 0"),
        (json!({ "extensions": { "KHR_materials_sheen": 7 } }), "extensions.KHR_materials_sheen"),
        (json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 2 } } }), "clearcoatFactor = 2"),
    ] {
        let warnings = with_material(json).told().1;
        let is_told = warnings.contains("materials[0]") && warnings.contains(what);
        assert!(is_told && warnings.contains("model.glb: "), "{what}: {warnings}");
    }
}

#[test]
fn images_with_the_same_bytes_are_one() {
    let pbr = json!({ "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 1 } });
    let mut model = with_material(json!({ "pbrMetallicRoughness": pbr }));
    let view = model.view(&png([0, 255, 0, 255]));
    model.json["images"] = json!([{ "bufferView": view }, { "bufferView": view, "name": "again" }]);
    model.push("textures", json!({ "source": 1 }));
    let of_view = model.scene();
    assert_eq!(of_view.images.len(), 1);
    assert_eq!(of_view.materials[0].maps.roughness.as_ref().map(|texture| texture.image_ix), Some(0));
    let folder = TempDir::new().unwrap();
    model.json["images"] = json!([{ "uri": "a.png" }, { "uri": "./a%2Epng" }]);
    fs::write(folder.path().join("a.png"), png([0, 255, 0, 255])).unwrap();
    fs::write(folder.path().join("m.glb"), model.glb()).unwrap();
    assert_eq!(Scene::load(&folder.path().join("m.glb")).unwrap().images.len(), 1);
}
