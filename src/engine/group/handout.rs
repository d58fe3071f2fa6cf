//! Hands out the rows of a picture to several devices, by their measured speeds.

use std::{ops::Range, time::Duration};

/// The rows of a picture, from the top to the bottom, and the speeds of the devices that draw them.
///
/// A device gets half of the rows that are left, times its share of all speeds: large tiles first, since each tile
/// costs some time of its own, and small tiles last, so that all devices end at about the same time (guided
/// self-scheduling: Polychronopoulos and Kuck 1987). If tiles have wide borders, which are drawn twice, each device gets
/// one tile.
pub struct Handout {
    /// The rows that no device has yet.
    left: Range<u32>,
    /// Number of rows of the smallest tile.
    least: u32,
    has_wide_borders: bool,
    devices: Vec<Device>,
}

/// What is known of a device.
#[derive(Clone, Copy, Default)]
struct Device {
    /// The rows that it has drawn, and the time that they took. Earlier pictures count half as much each time.
    n_rows: f64,
    seconds: f64,
    /// Whether it has a tile of the present picture.
    has_tile: bool,
    /// Whether it draws no more.
    is_lost: bool,
}

impl Handout {
    /// `least`: number of rows of the smallest tile.
    pub fn new(n_devices: usize, least: u32, has_wide_borders: bool) -> Self {
        Self { left: 0..0, least: least.max(1), has_wide_borders, devices: vec![Device::default(); n_devices] }
    }

    /// Begins a picture.
    pub fn begin(&mut self, rows: Range<u32>) {
        self.left = rows;
        for device in &mut self.devices {
            device.n_rows /= 2.0;
            device.seconds /= 2.0;
            device.has_tile = false;
        }
    }

    /// Returns the rows of the device's next tile, or `None` if none are left.
    pub fn take(&mut self, device_ix: usize) -> Option<Range<u32>> {
        if self.left.is_empty() {
            return None;
        }
        let n_left = self.left.len() as u32;
        let speeds = self.speeds();
        // With wide borders, the rows that are left are for the devices that have none.
        let counts = |device: &Device| !device.is_lost && !(self.has_wide_borders && device.has_tile);
        let counted = self.devices.iter().zip(&speeds).enumerate();
        let all: f64 =
            counted.filter(|(ix, (device, _))| *ix == device_ix || counts(device)).map(|(_, (_, speed))| speed).sum();
        let part = if self.has_wide_borders { 1.0 } else { 0.5 };
        let n_wanted = (f64::from(n_left) * part * speeds[device_ix] / all).round() as u32;
        let n_rows = n_wanted.clamp(self.least.min(n_left), n_left);
        // No tile is smaller than the least one.
        let n_rows = if n_left - n_rows < self.least { n_left } else { n_rows };
        self.devices[device_ix].has_tile = true;
        let rows = self.left.start..self.left.start + n_rows;
        self.left.start = rows.end;
        Some(rows)
    }

    /// Notes how long a tile took.
    pub fn note(&mut self, device_ix: usize, rows: &Range<u32>, time: Duration) {
        let device = &mut self.devices[device_ix];
        device.n_rows += rows.len() as f64;
        device.seconds += time.as_secs_f64();
    }

    /// Notes that a device draws no more.
    pub fn lose(&mut self, device_ix: usize) {
        self.devices[device_ix].is_lost = true;
    }

    /// Returns each device's rows a second. The speed of a device that has not been measured is the mean of the others.
    fn speeds(&self) -> Vec<f64> {
        let measured = |device: &Device| (device.seconds > 0.0).then(|| device.n_rows / device.seconds);
        let known: Vec<f64> = self.devices.iter().filter_map(measured).collect();
        let mean = if known.is_empty() { 1.0 } else { known.iter().sum::<f64>() / known.len() as f64 };
        self.devices.iter().map(|device| measured(device).unwrap_or(mean)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws a picture of `n_rows` rows with devices of the given rows a second. Returns each tile with its device, and
    /// the time at which each device ends.
    fn draw(handout: &mut Handout, n_rows: u32, speeds: &[f64]) -> (Vec<(usize, Range<u32>)>, Vec<f64>) {
        handout.begin(0..n_rows);
        let (mut ends, mut tiles) = (vec![0.0_f64; speeds.len()], Vec::new());
        loop {
            let next = (0..speeds.len()).min_by(|a, b| ends[*a].total_cmp(&ends[*b])).unwrap();
            let Some(rows) = handout.take(next) else { break };
            let seconds = rows.len() as f64 / speeds[next];
            handout.note(next, &rows, Duration::from_secs_f64(seconds));
            ends[next] += seconds;
            tiles.push((next, rows));
        }
        (tiles, ends)
    }

    #[test]
    fn every_row_is_drawn_once_and_devices_end_together() {
        for speeds in [&[1.0, 1.0][..], &[1.0, 3.0], &[5.0], &[2.0, 1.0, 1.0, 4.0]] {
            for wide in [false, true] {
                let mut handout = Handout::new(speeds.len(), 8, wide);
                for picture in 0..3 {
                    let (tiles, ends) = draw(&mut handout, 1080, speeds);
                    let mut next = 0;
                    for (_, rows) in &tiles {
                        assert_eq!(rows.start, next);
                        assert!(rows.len() >= 8);
                        next = rows.end;
                    }
                    assert_eq!(next, 1080);
                    let ideal = 1080.0 / speeds.iter().sum::<f64>();
                    let last = ends.iter().copied().fold(0.0, f64::max);
                    // One tile a device is right once the speeds are known.
                    let slack = if wide && picture == 0 { 4.0 } else { 1.05 };
                    assert!(last <= ideal * slack, "{speeds:?}, wide {wide}, picture {picture}: {ends:?}");
                    if wide {
                        assert!(tiles.len() <= speeds.len(), "{tiles:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn small_pictures_have_few_tiles() {
        let mut handout = Handout::new(4, 16, false);
        handout.begin(10..30);
        assert_eq!([handout.take(0), handout.take(3)], [Some(10..30), None]);
        handout.begin(0..40);
        assert_eq!([handout.take(1), handout.take(0), handout.take(2)], [Some(0..16), Some(16..40), None]);
        handout.begin(5..5);
        assert_eq!(handout.take(0), None);
    }

    #[test]
    fn the_rows_of_a_lost_device_go_to_the_others() {
        let mut handout = Handout::new(2, 1, true);
        handout.begin(0..100);
        assert_eq!(handout.take(0), Some(0..50));
        handout.lose(1);
        assert_eq!(handout.take(0), Some(50..100));
    }
}
