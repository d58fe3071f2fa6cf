//! Keyframes of meshes, lights and cameras (`keys` in scene files), and what lies between them.

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::description::read;
use crate::scene::model::{
    AnimationInfo,
    error::Checked,
    keys::{KeyTimes, Track},
    transform::{MovingTransform, TransformSpec},
};

/// The name of the animation that a scene file's keyframes make up.
const NAME: &str = "keys";

/// Reads keyframes. Each has a time in seconds and what it states beside it. Errors name the keyframe's number.
fn timed<T>(keys: Vec<Table>, read: impl Fn(Table) -> Checked<T>) -> Checked<Vec<(f64, T)>> {
    let mut before = f64::NEG_INFINITY;
    let key = |(number, mut key): (usize, Table)| {
        let named = |what: String| format!("key {number}: {what}");
        let time = time_of(&mut key).map_err(named)?;
        if time <= before {
            return Err(named(format!("its time, {time} s, is not after that of the key before it, {before} s")));
        }
        before = time;
        Ok((time, read(key).map_err(named)?))
    };
    (1..).zip(keys).map(key).collect()
}

fn time_of(key: &mut Table) -> Checked<f64> {
    let time = match key.remove("time") {
        None => return Err("has no `time`".to_owned()),
        Some(Value::Integer(time)) => time as f64,
        Some(Value::Float(time)) => time,
        Some(_) => return Err("its time is no number".to_owned()),
    };
    if time.is_finite() { Ok(time) } else { Err(format!("its time, {time} s, is not finite")) }
}

/// Returns the transform of a mesh that moves. At rest, it has the components that `rest` states, and the first
/// keyframe's for the others.
pub(crate) fn moving(rest: &TransformSpec, keys: Vec<Table>) -> Checked<MovingTransform> {
    MovingTransform::new(rest, &timed(keys, read::<TransformSpec>)?)
}

/// A TOML table, such as that of a light or a camera, with keyframes for its numbers.
#[derive(Clone, Debug)]
pub(crate) struct KeyedTable {
    /// What is stated beside the keyframes.
    rest: Table,
    /// What changes, by its name. A number is a list of one.
    tracks: Vec<(String, Track<Vec<f64>>)>,
    /// The times of the keyframes, ascending. Seconds.
    times: Vec<f64>,
}

impl KeyedTable {
    pub fn new(mut rest: Table) -> Checked<Self> {
        let keys = match rest.remove("keys") {
            Some(keys) => keys.try_into().map_err(|e: toml::de::Error| format!("keys: {}", e.message()))?,
            None => Vec::new(),
        };
        let keys =
            timed(keys, |key| key.into_iter().map(|(name, value)| Ok((numbers(&name, value)?, name))).collect())?;
        let mut keyed = Self { rest, tracks: Vec::new(), times: keys.iter().map(|key| key.0).collect() };
        for (number, (time, stated)) in (1..).zip(keys) {
            let stated: Vec<(Vec<f64>, String)> = stated;
            for (value, name) in stated {
                keyed.push((number, time), name, value)?;
            }
        }
        Ok(keyed)
    }

    fn push(&mut self, (number, time): (usize, f64), name: String, value: Vec<f64>) -> Checked<()> {
        let known = self.tracks.iter().position(|(other, _)| *other == name);
        let ix = known.unwrap_or_else(|| {
            self.tracks.push((name.clone(), Track::default()));
            self.tracks.len() - 1
        });
        let Track(keys) = &mut self.tracks[ix].1;
        match keys.last() {
            Some((_, before)) if before.len() != value.len() => {
                Err(format!("key {number}: {name} = {value:?}, but {before:?} in a key before it"))
            }
            _ => {
                keys.push((time, value));
                Ok(())
            }
        }
    }

    /// Reads the table as it is at a moment, seconds, or at rest.
    pub fn at<T: DeserializeOwned>(&self, seconds: Option<f64>) -> Checked<T> {
        let mut table = self.rest.clone();
        for (name, track) in &self.tracks {
            if seconds.is_none() && table.contains_key(name) {
                continue;
            }
            let numbers = track.at(seconds.unwrap_or(f64::NEG_INFINITY)).unwrap_or_default();
            let value = match numbers[..] {
                [number] => Value::Float(number),
                _ => Value::Array(numbers.into_iter().map(Value::Float).collect()),
            };
            table.insert(name.clone(), value);
        }
        read(table)
    }

    /// Checks the table at rest and at each of its keys.
    pub fn check<T: DeserializeOwned, U>(&self, check: impl Fn(&T) -> Checked<U>) -> Checked<()> {
        check(&self.at(None)?)?;
        for (number, time) in (1..).zip(&self.times) {
            let checked = self.at(Some(*time)).and_then(|spec| check(&spec));
            checked.map_err(|what| format!("key {number}: {what}"))?;
        }
        Ok(())
    }

    /// Returns the times of the keys, ascending.
    pub fn times(&self) -> &[f64] {
        &self.times
    }
}

/// Returns the numbers of a value of a key.
fn numbers(name: &str, value: Value) -> Checked<Vec<f64>> {
    let number = |value: Value| match value {
        Value::Integer(number) => Some(number as f64),
        Value::Float(number) => Some(number),
        _ => None,
    };
    let numbers = match value {
        Value::Array(values) => values.into_iter().map(number).collect(),
        value => number(value).map(|number| vec![number]),
    };
    numbers.ok_or_else(|| format!("`{name}` is neither a number nor numbers, so no key can change it"))
}

/// Returns what is known of the keys of a scene file as an animation, or `None` if nothing has any. `meshes` and
/// `tables`: the times of the keys of each mesh, and of each light and camera.
pub(crate) fn info<'a>(
    mut meshes: impl Iterator<Item = &'a [f64]>,
    mut tables: impl Iterator<Item = &'a [f64]>,
) -> Option<AnimationInfo> {
    let mut key_times = KeyTimes::default();
    let mut add = |all: &mut dyn Iterator<Item = &'a [f64]>| {
        all.filter(|times| !times.is_empty()).inspect(|times| key_times.add(times)).count()
    };
    let (n_moved, n_changed) = (add(&mut meshes), add(&mut tables));
    let ((begin, end), fps) = (key_times.ends(), key_times.fps());
    let info = AnimationInfo { name: NAME.to_owned(), begin, end, fps, n_moved, n_morphed: 0, n_changed };
    (n_moved + n_changed > 0).then_some(info)
}
