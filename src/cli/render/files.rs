//! The files that `kdray render` writes.

use std::path::{Path, PathBuf};

use kdray::{
    frame::{Aov, Picture},
    output::{self, FilmFormat, Format, HeatMap, Layers, OutputError},
    scene::Scene,
};

use super::names::{named, pattern_of, picture_names};
use crate::cli::{args::RenderArgs, error::CliError, file_roles::FileRoles};

/// A scene, and the file of its picture or, with a path, the pattern of the pictures' files.
pub struct Job {
    pub scene: PathBuf,
    pub output: PathBuf,
}

/// The files of one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Files {
    pub picture: PathBuf,
    /// The .exr file of the layers. It is the picture's own file if that is an .exr.
    layers: Option<PathBuf>,
    /// The .png file that shows each pixel's traversal cost as a colour.
    heat_map: Option<PathBuf>,
}

impl Files {
    pub fn of(picture: PathBuf, aovs: &[Aov]) -> Self {
        let is_exr = picture.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
        let layers = if is_exr { picture.clone() } else { picture.with_extension("exr") };
        Self {
            layers: (!aovs.is_empty()).then_some(layers),
            heat_map: aovs.contains(&Aov::Cost).then(|| picture.with_extension("cost.png")),
            picture,
        }
    }

    /// Returns the files beside the picture.
    pub fn beside(&self) -> impl Iterator<Item = &PathBuf> {
        self.layers.iter().chain(&self.heat_map).filter(|path| **path != self.picture)
    }

    /// Whether all files exist.
    pub fn exist(&self) -> bool {
        self.picture.exists() && self.beside().all(|path| path.exists())
    }

    /// Enters the files into `roles` as outputs. Refuses files that the command also reads, or that it writes twice.
    pub fn note(&self, roles: &mut FileRoles) -> Result<(), CliError> {
        roles.write("--output", &self.picture)?;
        self.beside().try_for_each(|path| roles.write("--aov", path))
    }

    /// Refuses files that cannot be written.
    pub fn check(&self) -> Result<(), CliError> {
        output::check(&self.picture)?;
        Ok(self.beside().try_for_each(|path| output::check(path))?)
    }

    /// Writes the picture before what lies beside it. A layer that cannot be written does not cost the picture: an .exr
    /// is then written without layers.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, picture: &Picture, layers: &Layers) -> Result<(), CliError> {
        let is_exr = self.picture.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
        if !is_exr {
            output::write_recorded(&self.picture, picture, layers.record)?;
        }
        if let Some(path) = self.layers.as_ref().or(is_exr.then_some(&self.picture)) {
            let written = output::write_layers(path, picture, layers);
            if is_exr && matches!(written, Err(OutputError::Encode { .. })) {
                output::write_layers(path, picture, &Layers { aovs: &[], ..*layers })?;
            }
            written?;
        }
        if let Some(path) = &self.heat_map {
            let values = layers.pixel_aovs.iter().map(|aovs| aovs.n_steps).collect();
            HeatMap { title: "steps a pixel", width: picture.width, height: picture.height, values }.write(path)?;
        }
        Ok(())
    }
}

/// Returns the roles of the command's files, without the pictures of a film's frames, which are not known yet.
/// Refuses outputs that the command also reads, or that it writes twice.
pub fn roles(args: &RenderArgs, jobs: &[Job]) -> Result<FileRoles, CliError> {
    let mut roles = FileRoles::default();
    jobs.iter().for_each(|job| roles.read_scene("SCENE", &job.scene, args.load.options()));
    args.list.iter().for_each(|list| roles.read("--list", list));
    args.path.iter().for_each(|path| roles.read("--path", path));
    if !args.is_film() {
        jobs.iter().try_for_each(|job| Files::of(job.output.clone(), &args.aov).note(&mut roles))?;
    }
    args.profile.iter().try_for_each(|path| roles.write("--profile", path))?;
    args.trace.iter().try_for_each(|path| roles.write("--trace", path))?;
    Ok(roles)
}

/// Refuses outputs that cannot be written, as far as they are known before the scene is loaded.
pub fn check_outputs(args: &RenderArgs, job: &Job) -> Result<(), CliError> {
    if args.output.is_some() {
        if args.is_film() && is_one_film(&job.output) {
            if !args.aov.is_empty() {
                let what = "--aov needs a file for each frame: an --output with ####, as in out.####.png";
                return CliError::refuse(what);
            }
            if job.output != Path::new(STDOUT) {
                output::check(&job.output)?;
            }
        } else {
            Format::of(&job.output)?;
            output::check(&job.output)?;
            if args.is_film() {
                numbered(&job.output, 0)?;
            }
        }
    }
    Ok([&args.profile, &args.trace].into_iter().flatten().try_for_each(|path| output::check(path))?)
}

/// Returns the job of the command's only scene.
pub fn only_job(args: &RenderArgs, scene: PathBuf) -> Job {
    let name = Scene::name_of(&scene);
    let in_folder = if args.is_film() { "{}.####.png" } else { "{}.png" };
    let output = match &args.output {
        None => default_output(&name, args.is_film()),
        Some(output) => match pattern_of(output, in_folder) {
            Some(pattern) if args.is_film() => named(&pattern, &output::stem_of(&name).replace('#', "-")),
            Some(pattern) => named(&pattern, &output::stem_of(&name)),
            None => output.clone(),
        },
    };
    Job { scene, output }
}

/// Returns the jobs of several scenes, in the order of the scenes.
///
/// # Errors
/// The output cannot name several pictures, or two scenes would have one picture.
pub fn jobs_of_several(args: &RenderArgs, scenes: Vec<PathBuf>) -> Result<Vec<Job>, CliError> {
    let pattern = match &args.output {
        None => Path::new("{}.png").to_owned(),
        Some(output) => pattern_of(output, "{}.png").ok_or_else(|| {
            let output = output.display();
            CliError::Usage(format!(
                "--output `{output}` names one picture: several scenes need a folder, as in out/, or {{}} for the \
                 scene's name, as in out/{{}}.exr"
            ))
        })?,
    };
    Format::of(&pattern)?;
    let names = picture_names(&scenes)?;
    let job = |(scene, name): (PathBuf, String)| Job { scene, output: named(&pattern, &name) };
    Ok(scenes.into_iter().zip(names).map(job).collect())
}

/// Returns a .png file in the working directory, named after the scene.
fn default_output(scene_name: &str, is_numbered: bool) -> PathBuf {
    let stem = output::stem_of(scene_name).replace('#', "-");
    format!("{stem}{}.png", if is_numbered { ".####" } else { "" }).into()
}

/// Stands for standard output.
pub const STDOUT: &str = "-";

/// Whether all frames of a film go to one file.
pub fn is_one_film(output: &Path) -> bool {
    let has_number = output.file_name().is_some_and(|name| name.to_string_lossy().contains('#'));
    !has_number && FilmFormat::of(output).is_some()
}

/// Returns the file of a frame's picture. The frame's number replaces the pattern's only run of `#` and has at least
/// as many digits.
pub fn numbered(pattern: &Path, frame: u32) -> Result<PathBuf, CliError> {
    let refused = |what| {
        let pattern = pattern.display();
        CliError::refuse(format!("--output `{pattern}` {what} #### for the frame's number, as in out.####.png"))
    };
    let Some(name) = pattern.file_name().and_then(|name| name.to_str()) else { return refused("has no") };
    let runs: Vec<&str> = name.split(|c| c != '#').filter(|run| !run.is_empty()).collect();
    match runs[..] {
        [] => refused("has no"),
        [run] => Ok(pattern.with_file_name(name.replace(run, &format!("{frame:0width$}", width = run.len())))),
        _ => refused("has more than one"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_s_name_stays_in_the_working_directory() {
        for (name, file) in [("cornell", "cornell.png"), ("../a", "..-a.png"), ("", "picture.png")] {
            assert_eq!(default_output(name, false), PathBuf::from(file));
        }
        assert_eq!(default_output("a#b", true), PathBuf::from("a-b.####.png"));
    }

    #[test]
    fn frames_have_numbers_in_place_of_their_signs() {
        for (pattern, frame, name) in [
            ("out.####.png", 7, "out.0007.png"),
            ("a#/x#.png", 12, "a#/x12.png"),
            ("##.exr", 1234, "1234.exr"),
            ("f_###_a.png", 0, "f_000_a.png"),
        ] {
            assert_eq!(numbered(Path::new(pattern), frame).unwrap(), PathBuf::from(name));
        }
        for pattern in ["out.png", "a##/out.png", "#a#.png", ""] {
            assert!(numbered(Path::new(pattern), 1).is_err(), "{pattern}");
        }
    }

    #[test]
    fn a_picture_outlives_a_layer_that_cannot_be_written() {
        let directory = tempfile::tempdir().unwrap();
        let picture =
            Picture { width: 2, height: 1, radiance: vec![[0.5, 1.5, 2.5, 1.0]; 2], display: vec![[9, 8, 7, 255]; 2] };
        for name in ["x.png", "y.exr"] {
            let path = directory.path().join(name);
            // The two pixels have no AOVs.
            let layers = Layers { aovs: &[Aov::Depth], ..Layers::default() };
            let error = Files::of(path.clone(), layers.aovs).write(&picture, &layers).unwrap_err();
            assert!(error.to_string().contains("cannot encode"), "{error}");
            assert_eq!(image::image_dimensions(&path).unwrap(), (2, 1), "{name}");
        }
        assert!(!directory.path().join("x.exr").exists(), "layers without their pixels");
    }

    #[test]
    fn what_lies_beside_a_picture() {
        let names = |picture: &str, aovs: &[Aov]| -> Vec<String> {
            let files = Files::of(picture.into(), aovs);
            files.beside().map(|path| path.display().to_string()).collect()
        };
        assert!(names("x.png", &[]).is_empty() && names("x.EXR", &[Aov::Depth]).is_empty());
        assert_eq!(names("a/x.png", &[Aov::Depth]), ["a/x.exr"]);
        assert_eq!(names("x.exr", &[Aov::Cost]), ["x.cost.png"]);
        assert_eq!(names("x.0001.png", &[Aov::Id, Aov::Cost]), ["x.0001.exr", "x.0001.cost.png"]);
    }
}
