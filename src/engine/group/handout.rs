//! Hands out work to several devices, by their measured speeds.

use std::{ops::Range, time::Duration};

/// Units of work in a row, such as rows of a picture, and the speeds of the devices that do them.
pub struct Handout {
    /// The units that no device has yet.
    left: Range<u32>,
    portions: Portions,
    devices: Vec<Device>,
}

/// How many ranges a device gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Portions {
    /// One range, according to its speed.
    OneEach,
    /// Half of the units that are left, times its share of all speeds, but at least `least`: large ranges first, since
    /// each range takes some time of its own, and small ones last, so that all devices end at about the same time
    /// (guided self-scheduling: Polychronopoulos and Kuck 1987).
    Many {
        /// Number of units of the smallest range.
        least: u32,
    },
}

/// What is known of a device.
#[derive(Clone, Copy, Default)]
struct Device {
    /// The units that it has done, and the time that they took. Earlier pictures count half as much each time.
    n_units: f64,
    seconds: f64,
    /// Whether it has a range of the present picture.
    has_range: bool,
    /// Whether it works no more.
    is_lost: bool,
}

impl Handout {
    /// Returns a handout without units.
    pub fn new(n_devices: usize, portions: Portions) -> Self {
        Self { left: 0..0, portions, devices: vec![Device::default(); n_devices] }
    }

    /// Begins a picture.
    pub fn begin(&mut self, units: Range<u32>) {
        self.left = units;
        for device in &mut self.devices {
            device.n_units /= 2.0;
            device.seconds /= 2.0;
            device.has_range = false;
        }
    }

    /// Returns the device's next range, or `None` if none are left.
    pub fn take(&mut self, device_ix: usize) -> Option<Range<u32>> {
        if self.left.is_empty() {
            return None;
        }
        let n_left = self.left.len() as u32;
        let speeds = self.speeds();
        // If each gets one range, the units that are left are for the devices that have none.
        let counts = |device: &Device| !device.is_lost && (self.portions != Portions::OneEach || !device.has_range);
        let counted = self.devices.iter().zip(&speeds).enumerate();
        let all: f64 =
            counted.filter(|(ix, (device, _))| *ix == device_ix || counts(device)).map(|(_, (_, speed))| speed).sum();
        let (part, least) = match self.portions {
            Portions::OneEach => (1.0, 1),
            Portions::Many { least } => (0.5, least.max(1)),
        };
        let n_wanted = (f64::from(n_left) * part * speeds[device_ix] / all).round() as u32;
        let n_units = n_wanted.clamp(least.min(n_left), n_left);
        // No range is smaller than the least one.
        let n_units = if n_left - n_units < least { n_left } else { n_units };
        self.devices[device_ix].has_range = true;
        let units = self.left.start..self.left.start + n_units;
        self.left.start = units.end;
        Some(units)
    }

    /// Notes how long a range took.
    pub fn note(&mut self, device_ix: usize, units: &Range<u32>, time: Duration) {
        let device = &mut self.devices[device_ix];
        device.n_units += units.len() as f64;
        device.seconds += time.as_secs_f64();
    }

    /// Notes that a device works no more.
    pub fn lose(&mut self, device_ix: usize) {
        self.devices[device_ix].is_lost = true;
    }

    /// Returns each device's units a second. A device that has not been measured has the mean speed of the others.
    fn speeds(&self) -> Vec<f64> {
        let measured = |device: &Device| (device.seconds > 0.0).then(|| device.n_units / device.seconds);
        let known: Vec<f64> = self.devices.iter().filter_map(measured).collect();
        let mean = if known.is_empty() { 1.0 } else { known.iter().sum::<f64>() / known.len() as f64 };
        self.devices.iter().map(|device| measured(device).unwrap_or(mean)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does `n_units` units with devices of the given units a second. Returns each range with its device, and the time
    /// at which each device ends.
    fn draw(handout: &mut Handout, n_units: u32, speeds: &[f64]) -> (Vec<(usize, Range<u32>)>, Vec<f64>) {
        handout.begin(0..n_units);
        let (mut ends, mut ranges) = (vec![0.0_f64; speeds.len()], Vec::new());
        loop {
            let next = (0..speeds.len()).min_by(|a, b| ends[*a].total_cmp(&ends[*b])).unwrap();
            let Some(units) = handout.take(next) else { break };
            let seconds = units.len() as f64 / speeds[next];
            handout.note(next, &units, Duration::from_secs_f64(seconds));
            ends[next] += seconds;
            ranges.push((next, units));
        }
        (ranges, ends)
    }

    #[test]
    fn every_unit_is_done_once_and_devices_end_together() {
        for speeds in [&[1.0, 1.0][..], &[1.0, 3.0], &[5.0], &[2.0, 1.0, 1.0, 4.0]] {
            for portions in [Portions::Many { least: 8 }, Portions::OneEach] {
                let mut handout = Handout::new(speeds.len(), portions);
                let one_each = portions == Portions::OneEach;
                for picture in 0..3 {
                    let (ranges, ends) = draw(&mut handout, 1080, speeds);
                    let mut next = 0;
                    for (_, units) in &ranges {
                        assert_eq!(units.start, next);
                        assert!(units.len() >= 8);
                        next = units.end;
                    }
                    assert_eq!(next, 1080);
                    let ideal = 1080.0 / speeds.iter().sum::<f64>();
                    let last = ends.iter().copied().fold(0.0, f64::max);
                    // One range a device is right once the speeds are known.
                    let slack = if one_each && picture == 0 { 4.0 } else { 1.05 };
                    assert!(last <= ideal * slack, "{speeds:?}, {portions:?}, picture {picture}: {ends:?}");
                    if one_each {
                        assert!(ranges.len() <= speeds.len(), "{ranges:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn little_work_has_few_ranges() {
        let mut handout = Handout::new(4, Portions::Many { least: 16 });
        handout.begin(10..30);
        assert_eq!([handout.take(0), handout.take(3)], [Some(10..30), None]);
        handout.begin(0..40);
        assert_eq!([handout.take(1), handout.take(0), handout.take(2)], [Some(0..16), Some(16..40), None]);
        handout.begin(5..5);
        assert_eq!(handout.take(0), None);
    }

    #[test]
    fn the_units_of_a_lost_device_go_to_the_others() {
        let mut handout = Handout::new(2, Portions::OneEach);
        handout.begin(0..100);
        assert_eq!(handout.take(0), Some(0..50));
        handout.lose(1);
        assert_eq!(handout.take(0), Some(50..100));
    }
}
