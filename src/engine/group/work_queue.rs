//! The queue of a picture's work, from which several devices take ranges according to their measured speeds.

use std::{ops::Range, time::Duration};

/// A queue of consecutive units of work, such as the rows of a picture, with the measured speed of each device.
pub struct WorkQueue {
    /// The units that no device has taken yet.
    left: Range<u32>,
    /// Ranges that were taken by devices that have failed.
    returned: Vec<Range<u32>>,
    chunking: Chunking,
    devices: Vec<Device>,
}

/// The rule by which the queue is cut into ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chunking {
    /// Each range is one unit.
    Single,
    /// Each device gets one range, whose size is proportional to the device's speed.
    OneEach,
    /// Guided self-scheduling (Polychronopoulos and Kuck 1987): a device gets half of the units that are left, times
    /// its share of the sum of all speeds, but at least `least` units. The first ranges are large, because each range
    /// has a fixed cost. The last ranges are small, so that all devices end at about the same time.
    Guided {
        /// Number of units of the smallest range.
        least: u32,
    },
}

/// The state of a device.
#[derive(Clone, Copy, Default)]
struct Device {
    /// Number of units that the device has done. At the beginning of each picture it is halved, so that older pictures
    /// count less.
    n_units: f64,
    /// The time that these units took, halved as `n_units` is.
    seconds: f64,
    /// Whether it has taken a range of the present picture.
    has_range: bool,
    has_failed: bool,
}

impl WorkQueue {
    /// Creates an empty queue for devices whose speeds are unknown.
    pub fn new(n_devices: usize, chunking: Chunking) -> Self {
        Self { left: 0..0, returned: Vec::new(), chunking, devices: vec![Device::default(); n_devices] }
    }

    /// Fills the queue with the units of a new picture.
    pub fn begin(&mut self, units: Range<u32>) {
        self.left = units;
        self.returned.clear();
        for device in &mut self.devices {
            device.n_units /= 2.0;
            device.seconds /= 2.0;
            device.has_range = false;
        }
    }

    /// Removes the device's next range from the queue and returns it. Returns `None` if the queue is empty.
    pub fn take(&mut self, device_ix: usize) -> Option<Range<u32>> {
        if let Some(range) = self.returned.pop() {
            return Some(range);
        }
        if self.left.is_empty() {
            return None;
        }
        let n_units = self.next_len(device_ix);
        self.devices[device_ix].has_range = true;
        let units = self.left.start..self.left.start + n_units;
        self.left.start = units.end;
        Some(units)
    }

    /// Returns the number of units of the device's next range.
    fn next_len(&self, device_ix: usize) -> u32 {
        let n_left = self.left.len() as u32;
        let (part, least) = match self.chunking {
            Chunking::Single => return 1,
            Chunking::OneEach => (1.0, 1),
            Chunking::Guided { least } => (0.5, least.max(1)),
        };
        let n_wanted = (f64::from(n_left) * part * self.share_of(device_ix)).round() as u32;
        let n_units = n_wanted.clamp(least.min(n_left), n_left);
        // A remainder of less than `least` units is added to this range.
        if n_left - n_units < least { n_left } else { n_units }
    }

    /// Adds a finished range to the measurement of the device's speed.
    pub fn record_time(&mut self, device_ix: usize, units: &Range<u32>, time: Duration) {
        let device = &mut self.devices[device_ix];
        device.n_units += units.len() as f64;
        device.seconds += time.as_secs_f64();
    }

    /// Records that a device has failed, and puts its unfinished range back into the queue.
    pub fn mark_failed(&mut self, device_ix: usize, unfinished: Range<u32>) {
        self.devices[device_ix].has_failed = true;
        self.returned.push(unfinished);
    }

    /// Returns the device's speed divided by the sum of the speeds of all devices that will take a range.
    fn share_of(&self, device_ix: usize) -> f64 {
        let speeds = self.speeds();
        // With one range for each device, those that have theirs take no more.
        let takes_more =
            |device: &Device| !device.has_failed && (self.chunking != Chunking::OneEach || !device.has_range);
        let sum: f64 = (self.devices.iter().zip(&speeds).enumerate())
            .filter(|(ix, (device, _))| *ix == device_ix || takes_more(device))
            .map(|(_, (_, speed))| speed)
            .sum();
        speeds[device_ix] / sum
    }

    /// Returns each device's speed in units per second. A device that has not been measured gets the mean speed of the
    /// others.
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

    /// Simulates devices that do `n_units` units at the given speeds in units per second. Returns each range with its
    /// device, and the time at which each device ends.
    fn draw(queue: &mut WorkQueue, n_units: u32, speeds: &[f64]) -> (Vec<(usize, Range<u32>)>, Vec<f64>) {
        queue.begin(0..n_units);
        let (mut ends, mut ranges) = (vec![0.0_f64; speeds.len()], Vec::new());
        loop {
            let next = (0..speeds.len()).min_by(|a, b| ends[*a].total_cmp(&ends[*b])).unwrap();
            let Some(units) = queue.take(next) else { break };
            let seconds = units.len() as f64 / speeds[next];
            queue.record_time(next, &units, Duration::from_secs_f64(seconds));
            ends[next] += seconds;
            ranges.push((next, units));
        }
        (ranges, ends)
    }

    #[test]
    fn every_unit_is_done_once_and_devices_end_together() {
        for speeds in [&[1.0, 1.0][..], &[1.0, 3.0], &[5.0], &[2.0, 1.0, 1.0, 4.0]] {
            for chunking in [Chunking::Guided { least: 8 }, Chunking::OneEach] {
                let mut queue = WorkQueue::new(speeds.len(), chunking);
                let one_each = chunking == Chunking::OneEach;
                for picture in 0..3 {
                    let (ranges, ends) = draw(&mut queue, 1080, speeds);
                    let mut next = 0;
                    for (_, units) in &ranges {
                        assert_eq!(units.start, next);
                        assert!(units.len() >= 8);
                        next = units.end;
                    }
                    assert_eq!(next, 1080);
                    let ideal = 1080.0 / speeds.iter().sum::<f64>();
                    let last = ends.iter().copied().fold(0.0, f64::max);
                    // With one range for each device, all end together only after the speeds have been measured.
                    let slack = if one_each && picture == 0 { 4.0 } else { 1.05 };
                    assert!(last <= ideal * slack, "{speeds:?}, {chunking:?}, picture {picture}: {ends:?}");
                    if one_each {
                        assert!(ranges.len() <= speeds.len(), "{ranges:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn little_work_has_few_ranges() {
        let mut queue = WorkQueue::new(4, Chunking::Guided { least: 16 });
        queue.begin(10..30);
        assert_eq!([queue.take(0), queue.take(3)], [Some(10..30), None]);
        queue.begin(0..40);
        assert_eq!([queue.take(1), queue.take(0), queue.take(2)], [Some(0..16), Some(16..40), None]);
        queue.begin(5..5);
        assert_eq!(queue.take(0), None);
    }

    #[test]
    fn single_units_are_taken_in_their_order() {
        let mut queue = WorkQueue::new(2, Chunking::Single);
        queue.begin(0..3);
        assert_eq!([0, 1, 1, 0].map(|device_ix| queue.take(device_ix)), [Some(0..1), Some(1..2), Some(2..3), None]);
    }

    #[test]
    fn the_units_of_a_failed_device_go_to_the_others() {
        let mut queue = WorkQueue::new(2, Chunking::OneEach);
        queue.begin(0..100);
        assert_eq!(queue.take(0), Some(0..50));
        assert_eq!(queue.take(1), Some(50..100));
        queue.mark_failed(1, 50..100);
        assert_eq!([queue.take(0), queue.take(0)], [Some(50..100), None]);
        // The next picture is not shared with it.
        queue.begin(0..60);
        assert_eq!([queue.take(0), queue.take(0)], [Some(0..60), None]);
    }
}
