//! Values between keys: what animations of glTF files, keys of scene files and camera paths have in common.

use glam::{DQuat, DVec3};

/// A place among keys that are in the order of their times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// The last key that has begun; before the first key, the first one.
    pub from: usize,
    /// The share of the time to the next key, from 0 to 1. It is 0 at a key, before the first one and behind the last.
    pub share: f64,
    /// The time from this key to the next one; 0 where `share` is 0.
    pub duration: f64,
}

impl Place {
    /// Finds a time among keys, of which there is at least one.
    pub fn among<K>(keys: &[K], time_of: impl Fn(&K) -> f64, time: f64) -> Self {
        let n_begun = keys.partition_point(|key| time_of(key) <= time);
        let from = n_begun.saturating_sub(1);
        let begun = time_of(&keys[from]);
        if n_begun == 0 || n_begun == keys.len() || begun == time {
            return Self { from, share: 0.0, duration: 0.0 };
        }
        let duration = time_of(&keys[from + 1]) - begun;
        Self { from, share: (time - begun) / duration, duration }
    }

    /// Returns the cubic Hermite spline from `a` to `b`, whose slopes there are `slopes`, per unit of time.
    pub fn spline(&self, [a, b]: [f64; 2], slopes: [f64; 2]) -> f64 {
        let (s, span) = (self.share, self.duration);
        // The weight of `a` is `1 - b_weight`.
        let b_weight = s * s * (3.0 - 2.0 * s);
        let (a_slope, b_slope) = (span * s * (1.0 - s) * (1.0 - s), span * s * s * (s - 1.0));
        a + (b - a) * b_weight + slopes[0] * a_slope + slopes[1] * b_slope
    }
}

/// A value of a key.
pub(crate) trait KeyValue: Clone {
    /// Returns the value that is at a share of the way to another one.
    fn towards(&self, other: &Self, share: f64) -> Self;
}

impl KeyValue for f64 {
    fn towards(&self, other: &Self, share: f64) -> Self {
        self + (other - self) * share
    }
}

impl KeyValue for DVec3 {
    fn towards(&self, other: &Self, share: f64) -> Self {
        *self + (*other - *self) * share
    }
}

impl KeyValue for Vec<f64> {
    fn towards(&self, other: &Self, share: f64) -> Self {
        self.iter().zip(other).map(|(a, b)| a.towards(b, share)).collect()
    }
}

/// A rotation, as a unit quaternion. Of the two turns to another one, it takes the shorter.
impl KeyValue for DQuat {
    fn towards(&self, other: &Self, share: f64) -> Self {
        self.slerp(*other, share)
    }
}

/// The keys of one value: times in ascending order, seconds, and the value at each.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Track<T>(pub Vec<(f64, T)>);

impl<T> Default for Track<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: KeyValue> Track<T> {
    /// Returns the value at a time: before the first key that of the first, and behind the last that of the last.
    /// `None` if there is no key.
    pub fn at(&self, seconds: f64) -> Option<T> {
        let keys = &self.0;
        if keys.is_empty() {
            return None;
        }
        let Place { from, share, .. } = Place::among(keys, |key| key.0, seconds);
        let value = &keys[from].1;
        Some(if share > 0.0 { value.towards(&keys[from + 1].1, share) } else { value.clone() })
    }
}

/// What is known of the times of keys, seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyTimes {
    begin: f64,
    end: f64,
    /// The shortest time between two keys.
    shortest: f64,
}

impl Default for KeyTimes {
    fn default() -> Self {
        Self { begin: f64::INFINITY, end: f64::NEG_INFINITY, shortest: f64::INFINITY }
    }
}

impl KeyTimes {
    /// Adds the times of some keys, in ascending order.
    pub fn add(&mut self, times: &[f64]) {
        let [Some(first), Some(last)] = [times.first(), times.last()] else { return };
        (self.begin, self.end) = (self.begin.min(*first), self.end.max(*last));
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        self.shortest = self.shortest.min(steps.fold(f64::INFINITY, f64::min));
    }

    /// Returns the times of the first and the last key, or 0 if there are none.
    pub fn ends(&self) -> (f64, f64) {
        if self.begin <= self.end { (self.begin, self.end) } else { (0.0, 0.0) }
    }

    /// Guesses the frames per second from the shortest time between keys.
    pub fn fps(&self) -> Option<f64> {
        let fps = 1.0 / self.shortest;
        let whole = fps.round();
        ((1.0..=240.0).contains(&whole) && (fps - whole).abs() < 0.01 * whole).then_some(whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_before_between_and_behind_keys() {
        let track = Track(vec![(1.0, vec![0.0, 5.0]), (3.0, vec![8.0, 5.0]), (4.0, vec![8.0, 6.0])]);
        for (seconds, expected) in [
            (f64::NEG_INFINITY, [0.0, 5.0]),
            (1.0, [0.0, 5.0]),
            (1.5, [2.0, 5.0]),
            (3.0, [8.0, 5.0]),
            (3.25, [8.0, 5.25]),
            (4.0, [8.0, 6.0]),
            (1e300, [8.0, 6.0]),
        ] {
            assert_eq!(track.at(seconds), Some(expected.to_vec()), "{seconds}");
        }
        assert_eq!(Track(vec![(2.0, 7.0)]).at(0.0), Some(7.0));
        assert_eq!(Track::<f64>::default().at(0.0), None);
    }

    #[test]
    fn rotations_take_the_shorter_turn() {
        let about_y = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians());
        for sign in [1.0, -1.0] {
            let track = Track(vec![(0.0, about_y(10.0)), (1.0, about_y(130.0) * sign)]);
            let found = track.at(0.25).unwrap();
            assert!(found.dot(about_y(40.0)).abs() > 1.0 - 1e-15, "{found}");
        }
        // A quaternion and its opposite are the same rotation, which lasts.
        let still = Track(vec![(0.0, about_y(70.0)), (1.0, -about_y(70.0))]);
        assert!(still.at(0.5).unwrap().dot(about_y(70.0)).abs() > 1.0 - 1e-15);
    }
}
