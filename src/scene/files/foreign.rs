//! Files that are no scenes, told by their first bytes, so that the message says what the user has in hand.

use std::path::Path;

/// First bytes of other files, and what these files are.
const FOREIGN: [(&[u8], &str); 26] = [
    (
        b"version https://git-lfs",
        "is a pointer of Git LFS, which stands for a larger file: `git lfs pull` fetches that file",
    ),
    (b"PK\x03\x04", "is a ZIP archive: unpack it first"),
    (b"\x1f\x8b", "is compressed by gzip: unpack it first"),
    (b"BZh", "is compressed by bzip2: unpack it first"),
    (b"7z\xbc\xaf", "is a 7z archive: unpack it first"),
    (b"Rar!", "is a RAR archive: unpack it first"),
    (b"Kaydara FBX Binary", "is an FBX file, which is not read: Blender, for example, saves it as glTF"),
    (b"; FBX ", "is an FBX file, which is not read: Blender, for example, saves it as glTF"),
    (b"DRACO", "is a Draco file, which is not read: `draco_decoder` saves it as PLY"),
    (b"BLENDER", "is a file of Blender: export it from there as glTF"),
    (b"PXR-USDC", "is a USD file, which is not read: Blender, for example, saves it as glTF"),
    (b"%PDF", "is a PDF document"),
    (b"//Maya ASCII", "is a file of Maya: export it from there as OBJ"),
    (b"#usda", "is a USD file, which is not read: Blender, for example, saves it as glTF"),
    (b"#VRML", "is a VRML file, which is not read: MeshLab, for example, saves it as PLY"),
    (b"# vtk DataFile", "is a VTK file, which is not read: ParaView, for example, saves it as PLY"),
    (b"VOX ", "is a file of MagicaVoxel: export it from there as OBJ or PLY"),
    (b"PMX ", "is an MMD model, which is not read: an add-on of Blender reads it"),
    (b"b3dm", "is a tile of 3D Tiles, which is not read: `3d-tiles-tools b3dmToGlb` takes the glTF file out of it"),
    (b"LASF", "is a cloud of points (LAS), without triangles to show. CloudCompare, for example, makes a mesh of it"),
    (
        b"ASTM-E57",
        "is a cloud of points (E57), without triangles to show. CloudCompare, for example, makes a mesh of it",
    ),
    (b"# .PCD", "is a cloud of points (PCD), without triangles to show. CloudCompare, for example, makes a mesh of it"),
    (b"Ogawa", "is an Alembic file, which is not read: Blender, for example, saves it as glTF"),
    (b"\x28\xb5\x2f\xfd", "is compressed by Zstandard, as files of Blender are: export those from there as glTF"),
    (b"OFF\n", "is an OFF file, which is not read: MeshLab, for example, saves it as PLY"),
    (b"OFF\r", "is an OFF file, which is not read: MeshLab, for example, saves it as PLY"),
];

/// Returns what a file is instead of a scene, if its first bytes tell.
pub fn what_it_is(bytes: &[u8]) -> Option<&'static str> {
    if bytes.is_empty() {
        return Some("is empty");
    }
    let known = FOREIGN.iter().find(|(first, _)| bytes.starts_with(first)).map(|(_, what)| *what);
    known.or_else(|| {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(1024)]).trim_start().to_lowercase();
        match () {
            () if head.starts_with("<!doctype html") || head.starts_with("<html") => {
                Some("is a web page: what was to be downloaded is not in it")
            }
            () if head.starts_with('<') && head.contains("<collada") => {
                Some("is a COLLADA file, which is not read: Blender 4, for example, saves it as glTF")
            }
            () if head.starts_with("iso-10303-21") && head.contains("ifc") => {
                Some("is an IFC file, which is not read: IfcConvert, for example, saves it as glTF")
            }
            () if head.starts_with("iso-10303-21") => {
                Some("is a STEP file, which has no triangles: FreeCAD, for example, saves it as OBJ or STL")
            }
            () if bytes.starts_with(b"FORM") && bytes.get(8..11) == Some(b"LWO") => {
                Some("is a file of LightWave, which is not read: Assimp, for example, saves it as glTF")
            }
            () => None,
        }
    })
}

/// Returns what a file is whose content does not tell by its first bytes, as those of an archive, by its name's ending.
fn of_name(path: &Path) -> Option<&'static str> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "3mf" => Some("is a 3MF file, which is not read: PrusaSlicer, for example, saves it as STL"),
        "usdz" => Some("is a USD file, which is not read: Blender, for example, saves it as glTF"),
        "3ds" => Some("is a 3DS file, which is not read: Assimp, for example, saves it as glTF"),
        "x3d" => Some("is an X3D file, which is not read: Blender, for example, saves it as glTF"),
        "xyz" | "pts" => Some("is a cloud of points, without triangles to show. CloudCompare makes a mesh of it"),
        "amf" => Some("is an AMF file, which is not read: PrusaSlicer, for example, saves it as STL"),
        "skp" => Some("is a file of SketchUp: export it from there as OBJ"),
        "max" => Some("is a file of 3ds Max: export it from there as glTF or OBJ"),
        "mtl" => Some("holds the materials of an OBJ file: name the OBJ file"),
        "gcode" => Some("holds the moves of a printer: name the STL file from which it was made"),
        "png" | "jpg" | "jpeg" | "tif" | "tiff" | "tga" | "bmp" | "webp" | "gif" | "hdr" | "exr" | "dds" | "ktx2" => {
            Some("is an image and no scene")
        }
        "dxf" => Some("is a DXF file, which is not read: FreeCAD, for example, saves it as OBJ or STL"),
        "igs" | "iges" => Some("is an IGES file, which has no triangles: FreeCAD, for example, saves it as OBJ or STL"),
        _ => None,
    }
}

/// Returns why a file whose name has another ending than those of scenes is no scene.
pub fn of_other_name(path: &Path, bytes: &[u8]) -> String {
    match of_name(path).or_else(|| what_it_is(bytes)) {
        Some(what) => what.to_owned(),
        None if path.is_dir() => "is a folder: name a file in it".to_owned(),
        None => {
            let endings = ".toml, .gltf, .glb, .obj, .ply, .stl and .kdpack";
            format!("is no scene: its name ends in none of {endings}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_scenes_are_told_by_their_content() {
        for (bytes, what) in [
            (&b""[..], "is empty"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:aa", "git lfs pull"),
            (b"PK\x03\x04abc", "ZIP"),
            (b"\n <!DOCTYPE HTML><html>", "web page"),
            (b"<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"\">", "COLLADA"),
            (b"Kaydara FBX Binary  \0", "FBX"),
            (b"VOX \x96\0\0\0", "MagicaVoxel"),
            (b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC4'));", "an IFC file"),
            (b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AP214'));", "a STEP file"),
            (b"FORM\0\0\x12\x34LWO2TAGS", "LightWave"),
            (b"BZh91AY&SY", "bzip2"),
            (b"; FBX 7.4.0 project file", "an FBX file"),
            (b"\x28\xb5\x2f\xfd\0", "Zstandard"),
        ] {
            assert!(what_it_is(bytes).unwrap().contains(what), "{what}");
        }
        for scene in [&b"v 0 0 0\n"[..], b"# <html>\n", b"solid x", b"ply\n", b"glTF\x02", b"{ }", b"version 1"] {
            assert_eq!(what_it_is(scene), None);
        }
    }

    #[test]
    fn the_other_name_counts_if_the_content_does_not_tell() {
        assert!(of_other_name(Path::new("a.txt"), b"hello").contains("ends in none of .toml"));
        assert!(of_other_name(Path::new("a.3MF"), b"PK\x03\x04").contains("a 3MF file"));
        assert!(of_other_name(Path::new("a.mtl"), b"newmtl a\n").contains("name the OBJ file"));
        assert!(of_other_name(Path::new("a.zip"), b"PK\x03\x04").contains("a ZIP archive"));
        assert!(of_other_name(Path::new("a.off"), b"OFF\n3 1 0\n").contains("an OFF file"));
        assert!(of_other_name(Path::new("a.fbx"), b"Kaydara FBX Binary  \0").contains("FBX"));
        assert!(of_other_name(Path::new("/"), b" ").contains("a folder"));
        for image in ["png", "jpg", "tif", "tga", "bmp", "webp", "gif", "hdr", "exr", "dds", "ktx2"] {
            let path = format!("a.{image}");
            assert!(of_other_name(Path::new(&path), b"\0").contains("is an image"), "{path}");
        }
    }
}
