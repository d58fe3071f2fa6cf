//! What moves in a scene file: meshes by their keys, and the animations of the glTF files that it names.

use std::collections::HashSet;

use glam::DVec3;

use super::{
    assemble::File,
    placed::{MeshTable, Reading},
};
use crate::scene::{
    formats::{
        gltf,
        mesh_file::{MeshFile, MeshFormat},
    },
    model::{
        AnimationChoice, AnimationInfo, LoadOptions, Scene, SceneError, Transform, error::Checked,
        transform::MovingTransform,
    },
};

/// Instances that keys move.
pub(crate) struct Moving {
    /// The number of their table, counted from 1.
    pub number: usize,
    pub place: MovingTransform,
    /// Where the table's array places the mesh, if it has one.
    pub array: Option<Vec<Transform>>,
    /// The index of the first of them in the scene.
    pub first_instance: usize,
    /// The transforms of the file's instances, which come before that of the table.
    pub inner: Vec<Transform>,
}

impl Moving {
    /// Moves the instances of a scene to their places at a time, seconds.
    pub fn pose(&self, seconds: f64, scene: &mut Scene) -> Checked<()> {
        let own = self.place.at(Some(seconds)).map_err(|what| format!("mesh {}: {what}", self.number))?;
        let places = places_of(own, self.array.as_deref());
        let transforms = self.inner.iter().flat_map(|inner| places.iter().map(|place| place.after(inner)));
        for (instance, transform) in scene.instances[self.first_instance..].iter_mut().zip(transforms) {
            instance.transform = match scene.origin {
                DVec3::ZERO => transform,
                origin => transform.moved(-origin),
            };
        }
        Ok(())
    }
}

/// Returns the transforms by which a table places its mesh: its own, followed by each of its array, if it has one.
pub(crate) fn places_of(own: Transform, array: Option<&[Transform]>) -> Vec<Transform> {
    match array {
        Some(array) => array.iter().map(|place| place.after(&own)).collect(),
        None => vec![own],
    }
}

/// The animations of a scene file: its keys, and those of the glTF files that it names.
pub(crate) struct Animations {
    /// What is known of those that have been read.
    pub infos: Vec<AnimationInfo>,
    /// Whether the first one is that of the keys.
    has_own: bool,
    /// The moment of the keys; none if they are not shown.
    pub of_keys: Option<f64>,
    /// The moment of the glTF files.
    pub at: Option<f64>,
    /// The animations that are shown.
    choice: AnimationChoice,
    /// The file whose animation is shown alone, if one is chosen.
    only: Option<Reading>,
}

impl Animations {
    /// Finds what the options choose. `own`: the animation that the keys are, if there are any.
    ///
    /// # Errors
    /// There is no such animation.
    pub fn new(
        file: &File,
        (tables, own): (&[MeshTable], Option<AnimationInfo>),
        options: &LoadOptions,
    ) -> Result<Self, SceneError> {
        let has_own = own.is_some();
        let (at, of_keys) = (options.at, options.moment().map(|moment| moment.seconds));
        let (choice, infos) = (options.animation.clone(), own.into_iter().collect());
        let mut animations = Self { infos, has_own, of_keys, at, choice, only: None };
        if !matches!(options.animation, AnimationChoice::Named(_)) {
            return Ok(animations);
        }
        // The files are asked for their names before they are read.
        let mut named: Vec<(Option<Reading>, usize, String)> =
            animations.infos.iter().map(|info| (None, 0, info.name.clone())).collect();
        for (reading, infos) in infos_of_files(file, tables, options)? {
            let of_file = infos.into_iter().enumerate().map(|(ix, info)| (Some(reading.clone()), ix, info.name));
            named.extend(of_file);
        }
        let names: Vec<&str> = named.iter().map(|(.., name)| name.as_str()).collect();
        let found = options.animation.among(&names).map_err(|what| file.source.error(what))?;
        let (reading, ix, _) = named.swap_remove(found[0]);
        animations.of_keys = animations.of_keys.filter(|_| reading.is_none());
        (animations.only, animations.choice) = (reading, AnimationChoice::Named(ix.to_string()));
        Ok(animations)
    }

    /// Returns what is shown of a file's animations.
    pub fn of_file(&self, reading: &Reading) -> AnimationChoice {
        match &self.choice {
            AnimationChoice::Named(_) if self.only.as_ref() != Some(reading) => AnimationChoice::None,
            choice => choice.clone(),
        }
    }

    /// Whether animations of glTF files are shown, once all files are read.
    pub fn plays_files(&self) -> bool {
        let has_any = self.infos.len() > usize::from(self.has_own);
        has_any && (self.choice == AnimationChoice::All || self.only.is_some())
    }
}

/// Returns the animations of the glTF files that tables name, in the order of the tables.
pub(crate) fn infos_of_files(
    file: &File,
    tables: &[MeshTable],
    options: &LoadOptions,
) -> Result<Vec<(Reading, Vec<AnimationInfo>)>, SceneError> {
    let mut seen = HashSet::new();
    let readings = tables.iter().filter_map(|table| Reading::of(file, &table.spec, options.recentre).ok()?);
    let mut infos = Vec::new();
    for reading in readings.filter(|it| seen.insert(it.clone())) {
        // A file that cannot be read is refused later, with the place of its table.
        let Ok(mesh) = MeshFile::read(&reading.file) else { continue };
        if mesh.format == MeshFormat::Gltf {
            infos.push((reading, gltf::animations(mesh, options).unwrap_or_default()));
        }
    }
    Ok(infos)
}
