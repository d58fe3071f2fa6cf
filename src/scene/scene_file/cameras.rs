//! Cameras of scene files, which keys may move.

use std::path::Path;

use glam::DVec3;
use toml::{Spanned, Table, Value};

use super::{
    assemble::{File, camera},
    keyframes::KeyedTable,
};
use crate::scene::model::{Scene, SceneError, error::Checked};

/// The cameras of a scene file.
#[derive(Clone, Debug)]
pub(crate) struct Cameras {
    /// `[camera]`.
    own: Option<KeyedTable>,
    /// `[[cameras]]`, by their names.
    named: Vec<(String, KeyedTable)>,
}

impl Cameras {
    /// Reads the tables, which are checked at rest and at all keys.
    pub fn new(file: &File, own: Option<&Spanned<Table>>, named: &[Spanned<Table>]) -> Result<Self, SceneError> {
        let own = own.map(|table| file.check("camera", table, |table| keyed(table.clone()))).transpose()?;
        let named = (1..).zip(named).map(|(number, table)| {
            file.check(&format!("camera {number}"), table, |table| {
                let mut table = table.clone();
                match table.remove("name") {
                    Some(Value::String(name)) => Ok((name, keyed(table)?)),
                    Some(_) => Err("its `name` is no string".to_owned()),
                    None => Err("missing field `name`".to_owned()),
                }
            })
        });
        Ok(Self { own, named: named.collect::<Result<_, _>>()? })
    }

    /// Gives a scene of the file the cameras that it has at a moment, seconds, or at rest.
    pub fn pose(&self, path: &Path, seconds: Option<f64>, scene: &mut Scene) -> Result<(), SceneError> {
        let origin = scene.origin;
        let at = |(object, keyed): (String, &KeyedTable)| {
            let posed = keyed.at(seconds).and_then(|spec| camera(&spec, origin));
            posed.map_err(|what| SceneError::file(path, format!("{object}: {what}")))
        };
        scene.cameras.clear();
        for (number, (name, keyed)) in (1..).zip(&self.named) {
            scene.cameras.push((name.clone(), at((format!("camera {number}"), keyed))?));
        }
        if let Some(own) = &self.own {
            scene.camera = at(("camera".to_owned(), own))?;
        } else if let Some((_, first)) = scene.cameras.first() {
            scene.camera = *first;
        }
        Ok(())
    }

    /// Returns the times of the keys of each camera, ascending.
    pub fn times(&self) -> impl Iterator<Item = &[f64]> {
        self.own.iter().chain(self.named.iter().map(|(_, keyed)| keyed)).map(KeyedTable::times)
    }
}

fn keyed(table: Table) -> Checked<KeyedTable> {
    let keyed = KeyedTable::new(table)?;
    keyed.check(|spec| camera(spec, DVec3::ZERO))?;
    Ok(keyed)
}
