//! Scene files made from other files: a mesh or glTF file with its cameras, lights and materials in tables, to be
//! edited; or a scene file for another folder. The result shows the same picture.

mod relative;
mod text;

use std::path::Path;

use toml::{Table, Value};

use self::relative::OutputFolder;
use super::sources::{is_scene_file, names_of_files};
use crate::scene::{
    files::{SourceFile, pack::pack_of},
    model::{LoadOptions, Look, Scene, SceneError},
};

/// Returns the text of a scene file that shows what `input` shows. The names of files in it are relative to the folder
/// of `output`, where the text is to be written; this function does not write it. `options` say how `input` is loaded,
/// and its camera becomes `[camera]`.
///
/// # Errors
/// The input cannot be loaded, or a file does not lie below the folder of `output` and `options` do not allow it.
pub fn scene_file_of(input: &Path, output: &Path, options: &LoadOptions) -> Result<String, SceneError> {
    let scene = Scene::load_with(input, options)?;
    if pack_of(input).is_some() {
        let what = "is in a pack: it can be converted before it is packed, or once `unzip` has unpacked it";
        return Err(SceneError::file(input, what));
    }
    let places = OutputFolder::new(output, options)?;
    if is_scene_file(input) {
        return moved(input, &places, (&scene, options));
    }
    let mesh = text::MeshTable {
        file: places.name_of(input)?,
        scene: options.scene.clone(),
        shows_back_faces: options.look.shows_back_faces,
        replaced: options.look.materials.clone(),
    };
    Ok(text::scene_file(&scene, &mesh))
}

/// Returns a scene file's text with the names of files relative to the folder of the output, and with the camera, the
/// lights and the background that `options` choose, as `scene` has them. A text that needs no change keeps its
/// comments.
fn moved(input: &Path, places: &OutputFolder, (scene, options): (&Scene, &LoadOptions)) -> Result<String, SceneError> {
    let text = SourceFile::new(input, options).text()?;
    let folder = input.parent().unwrap_or(Path::new(""));
    if places.is_here(folder) && options.camera.is_none() && options.look == Look::default() {
        return Ok(text);
    }
    let mut table: Table = text.parse().map_err(|error: toml::de::Error| SceneError::file(input, error.message()))?;
    let parsed = |text: String| text.parse::<Table>().expect("the text of a table is TOML");
    if options.camera.is_some() || options.look.has_camera() {
        table.insert("camera".to_owned(), Value::Table(parsed(text::camera(&scene.camera, scene.origin))));
    }
    if options.look.sky.is_some() {
        for key in ["light", "ambient", "background", "environment"] {
            table.remove(key);
        }
        unmeter(&mut table);
    }
    if let Some(sky) = scene.sky.filter(|_| options.look.sky.is_some() || options.look.light.is_some()) {
        table.insert("sky".to_owned(), Value::Table(parsed(text::sky(&sky))));
    }
    if options.look.light.is_some() {
        // Without `ambient`, a file that has no lights would be given some.
        let lights: String = scene.lights.iter().map(text::light).collect();
        table.remove("light");
        table.extend(parsed(format!("ambient = {}\n{lights}", text::ambient(scene))));
        unmeter(&mut table);
    }
    if options.look.light.is_some() || options.look.background.is_some() {
        table.extend(parsed(format!("background = {}\n", text::vector(scene.background))));
    }
    if options.look.shows_back_faces {
        table.insert("cull".to_owned(), Value::String("off".to_owned()));
    }
    if !options.look.materials.is_empty() {
        let words = options.look.materials.iter().map(|choice| Value::String(choice.to_string()));
        let replace = table.entry("replace").or_insert(Value::Array(Vec::new()));
        replace.as_array_mut().expect("the input is loaded, so this is a list").extend(words);
    }
    for (_, name) in names_of_files(&mut table) {
        *name = places.name_of(&folder.join(&*name))?;
    }
    toml::to_string(&table).map_err(|error| SceneError::file(input, error.to_string()))
}

/// Lets the exposure of a scene file be the stated one: a scene without the lights of its file is not metered.
fn unmeter(table: &mut Table) {
    if let Some(Value::Table(render)) = table.get_mut("render") {
        render.remove("metered");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_meshes_materials_and_the_environment_are_named() {
        let text = "environment = { file = \"sky.hdr\" }\nmesh = [{ file = \"a.obj\", instances = \"c.npy\" }]\n\
                    materials = { m = { map_Kd = \"b.png\" } }\n";
        let mut table: Table = text.parse().unwrap();
        let mut names: Vec<String> = names_of_files(&mut table).into_iter().map(|(_, name)| name.clone()).collect();
        names.sort();
        assert_eq!(names, ["a.obj", "b.png", "c.npy", "sky.hdr"]);
    }
}
