//! MTL files. They are checked and rewritten line by line, read by tobj and converted to materials.
//!
//! A colour of one number is a grey in MTL, but tobj 4.0.5 panics on it; so it is rewritten as three numbers.

use std::{
    borrow::Cow,
    fmt::Write,
    path::{Path, PathBuf},
};

use super::clean::{split_keyword, statements};
use crate::scene::{
    error::{Checked, SceneError},
    material::{Material, MaterialSpec},
    read::read_lossy,
};

/// Materials of MTL files. If several have the same name, the last one counts.
#[derive(Clone, Debug, Default)]
pub struct Library {
    pub materials: Vec<Material>,
}

impl Library {
    /// Returns whether there is a material of this name.
    pub fn has(&self, name: &str) -> bool {
        self.materials.iter().any(|material| material.name == name)
    }
}

/// Reads the files that the `mtllib` lines of an OBJ file name, relative to its folder. Warns of a file that does not
/// exist.
pub fn load_libraries(obj: &Path, libraries: &[(usize, String)]) -> Result<Library, SceneError> {
    let mut library = Library::default();
    let folder = obj.parent().unwrap_or(Path::new(""));
    for (line, rest) in libraries {
        for file in library_files(folder, rest).map_err(|what| SceneError::line(obj, *line, what))? {
            if file.exists() {
                load_library(&file, &mut library)?;
            } else {
                let (obj, file) = (obj.display(), file.display());
                tracing::warn!("{obj}:{line}: {file} does not exist: its materials become the default one");
            }
        }
    }
    Ok(library)
}

/// Returns the files that the `mtllib` statements of an OBJ file's text name. Names that are refused are left out.
pub fn named_libraries(obj: &Path, text: &str) -> Vec<PathBuf> {
    let folder = obj.parent().unwrap_or(Path::new(""));
    let files = |(_, statement): (usize, Cow<str>)| match split_keyword(&statement) {
        ("mtllib", rest) => library_files(folder, rest).unwrap_or_default(),
        _ => Vec::new(),
    };
    statements(text).flat_map(files).collect()
}

/// Returns the files that a `mtllib` line names. The rest of the line is one name, possibly with spaces, if such a
/// file exists; otherwise it is a list of names.
fn library_files(folder: &Path, rest: &str) -> Checked<Vec<PathBuf>> {
    let whole = inside(folder, rest)?;
    if whole.exists() {
        return Ok(vec![whole]);
    }
    rest.split_whitespace().map(|name| inside(folder, name)).collect()
}

/// Returns the path of a file below the folder. Backslashes count as separators, as in files from Windows.
fn inside(folder: &Path, name: &str) -> Checked<PathBuf> {
    let climbs = name.split(['/', '\\']).any(|part| part == "..");
    let is_absolute = name.starts_with(['/', '\\']) || name.chars().nth(1) == Some(':');
    if climbs || is_absolute {
        return Err(format!("mtllib `{name}` leaves the folder of the OBJ file: it is not read"));
    }
    Ok(folder.join(name.replace('\\', "/")))
}

fn load_library(path: &Path, library: &mut Library) -> Result<(), SceneError> {
    let text = read_lossy(path)?;
    let clean = clean_mtl(&text).map_err(|(line, what)| SceneError::line(path, line, what))?;
    let (materials, _) =
        tobj::load_mtl_buf(&mut clean.as_bytes()).map_err(|e| SceneError::file(path, e.to_string()))?;
    for material in materials {
        let spec = spec(&material);
        let named = |what| SceneError::file(path, format!("material `{}`: {what}", material.name));
        library.materials.push(spec.material(&material.name).map_err(named)?);
    }
    Ok(())
}

/// Returns the statements of the terms that are rendered. Numbers are checked and greys are written as three numbers.
/// Textures and all other statements are left out.
fn clean_mtl(text: &str) -> Result<String, (usize, String)> {
    let mut clean = String::new();
    for (line, statement) in statements(text) {
        let (keyword, rest) = split_keyword(&statement);
        let cleaned = match keyword {
            "newmtl" if rest.is_empty() => Err("newmtl names no material".to_owned()),
            "newmtl" => Ok(rest.to_owned()),
            "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => rgb(keyword, rest),
            "Ns" | "Ni" | "d" | "Tr" => number(keyword, rest),
            "illum" => illum(rest),
            _ => continue,
        };
        let cleaned = cleaned.map_err(|what| (line, what))?;
        writeln!(clean, "{keyword} {cleaned}").expect("a String takes what it is given");
    }
    Ok(clean)
}

/// Returns the words before a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split('#').next().unwrap_or_default().split_whitespace()
}

/// Returns `r g b`. One number alone is a grey.
fn rgb(keyword: &str, rest: &str) -> Checked<String> {
    let parts: Vec<&str> = words(rest).collect();
    for part in &parts {
        finite(keyword, part)?;
    }
    match parts[..] {
        [grey] => Ok([grey, grey, grey].join(" ")),
        [_, _, _] => Ok(parts.join(" ")),
        _ => Err(format!("{keyword} has {} numbers: it takes 3, or 1 for a grey", parts.len())),
    }
}

fn number(keyword: &str, rest: &str) -> Checked<String> {
    let mut parts = words(rest);
    // `d -halo x` is an opacity that varies with the angle of view; x is its value where the surface faces the eye.
    let number = parts.find(|part| *part != "-halo").unwrap_or_default();
    finite(keyword, number)?;
    Ok(number.to_owned())
}

fn illum(rest: &str) -> Checked<String> {
    match words(rest).next().unwrap_or_default().parse::<u8>() {
        Ok(illum @ 0..=10) => Ok(illum.to_string()),
        _ => Err(format!("illum `{rest}` is not one of 0 to 10")),
    }
}

fn finite(keyword: &str, word: &str) -> Checked<()> {
    match word.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(()),
        _ => Err(format!("{keyword} `{word}` is not a finite number")),
    }
}

/// Converts a material of tobj, which keeps the terms that it does not know (Tf, Tr) as text.
fn spec(material: &tobj::Material) -> MaterialSpec {
    let unknown = |term: &str| -> Option<Vec<f32>> {
        material.unknown_param.get(term).map(|text| text.split_whitespace().flat_map(str::parse).collect())
    };
    MaterialSpec {
        ka: material.ambient,
        kd: material.diffuse,
        ks: material.specular,
        ke: material.emissive,
        tf: unknown("Tf").and_then(|tf| tf.try_into().ok()),
        ns: material.shininess,
        ni: material.optical_density,
        d: material.dissolve,
        // Files often have both; the format documents only d.
        tr: unknown("Tr").filter(|_| material.dissolve.is_none()).and_then(|tr| tr.first().copied()),
        illum: material.illumination_model,
    }
}
