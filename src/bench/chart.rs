//! Bar charts as SVG, with the bars in groups.

use std::error::Error;

use plotters::{
    element::{EmptyElement, Rectangle, Text},
    prelude::{ChartBuilder, Color, IntoDrawingArea, IntoFont, RGBColor, SVGBackend, SeriesLabelPosition, WHITE},
    style::{
        BLACK,
        text_anchor::{HPos, Pos, VPos},
    },
};

/// Height of the picture, in pixels.
const HEIGHT: u32 = 480;
/// Width of a group, in pixels.
const GROUP_WIDTH: u32 = 96;
/// Width of the space to the left and right of the groups, in pixels.
const SIDE_WIDTH: u32 = 100;
/// Smallest width of the picture, in pixels.
const MIN_WIDTH: u32 = 640;
/// Fraction of a group's width that its bars fill.
const BARS_SHARE: f64 = 0.8;
/// Fraction of the value axis that stays free above the bars for the legend.
const LEGEND_SHARE: f64 = 0.25;
/// Eight colours that colour-blind people can tell apart (Okabe and Ito 2008, with a darker yellow).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(213, 94, 0),
    RGBColor(190, 178, 40),
    RGBColor(90, 90, 90),
];

/// A bar chart of several series. The bars of one group are side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct BarChart {
    pub title: String,
    /// Unit of the values, written along the value axis.
    pub unit: String,
    pub scale: Scale,
    /// Names of the groups. A line break starts a second line.
    pub groups: Vec<String>,
    pub series: Vec<Series>,
}

/// Bars of one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    /// One value per group, above 0, or `None` for no bar.
    pub values: Vec<Option<f64>>,
}

/// Scale of the value axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Linear, from 0.
    Linear,
    /// Logarithmic, from the power of ten at or below the least value.
    Logarithmic,
}

impl Scale {
    /// Returns a value's position on the axis.
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Logarithmic => value.log10(),
        }
    }

    /// Returns the positions of the bottom and the top of the axis, with space for the legend above the longest bar.
    fn axis(self, values: impl Iterator<Item = f64>) -> (f64, f64) {
        let values = values.filter(|value| *value > 0.0).map(|value| self.place(value));
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if least > most {
            return (0.0, 1.0);
        }
        let bottom = if self == Self::Linear { 0.0 } else { least.floor() };
        let length = if self == Self::Linear { most } else { (most - bottom).max(1.0) };
        (bottom, bottom + length / (1.0 - LEGEND_SHARE))
    }

    /// Returns the largest number of labels on an axis.
    fn n_labels(self, length: f64) -> usize {
        match self {
            Self::Linear => 10,
            Self::Logarithmic => length as usize + 1,
        }
    }

    /// Returns the label of a position on the axis, which may be empty.
    fn label(self, place: f64) -> String {
        let is_power = (place - place.round()).abs() < 1e-6;
        match self {
            Self::Linear => format!("{}", (place * 1e6).round() / 1e6),
            Self::Logarithmic if is_power => format!("{}", 10f64.powf(place.round())),
            Self::Logarithmic => String::new(),
        }
    }
}

impl BarChart {
    /// Returns the text of an SVG file.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        self.draw(&mut svg).expect("drawing to memory");
        svg
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn Error + '_>> {
        let n_groups = self.groups.len();
        let width = (SIDE_WIDTH + GROUP_WIDTH * n_groups as u32).max(MIN_WIDTH);
        let area = SVGBackend::with_string(svg, (width, HEIGHT)).into_drawing_area();
        area.fill(&WHITE)?;
        let (bottom, top) =
            self.scale.axis(self.series.iter().flat_map(|series| series.values.iter().flatten().copied()));
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 20))
            .margin(10)
            .x_label_area_size(45)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..n_groups.max(1) as f64, bottom..top)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .y_max_light_lines(1)
            .x_labels(0)
            .y_labels(self.scale.n_labels(top - bottom))
            .y_desc(&self.unit)
            .y_label_formatter(&|place| self.scale.label(*place))
            .label_style(("sans-serif", 13))
            .draw()?;
        for (series_ix, series) in self.series.iter().enumerate() {
            let colour = COLOURS[series_ix % COLOURS.len()];
            let bars = series.values.iter().enumerate().filter_map(|(group_ix, value)| {
                let value = value.filter(|value| *value > 0.0)?;
                let (left, right) = self.bar(group_ix, series_ix);
                Some(Rectangle::new([(left, bottom), (right, self.scale.place(value))], colour.filled()))
            });
            chart
                .draw_series(bars)?
                .label(&series.name)
                .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], colour.filled()));
        }
        let centred = ("sans-serif", 13).into_font().color(&BLACK).pos(Pos::new(HPos::Center, VPos::Top));
        for (group_ix, name) in self.groups.iter().enumerate() {
            for (line_ix, line) in name.lines().enumerate() {
                let offset = (0, 8 + 16 * line_ix as i32);
                let label = Text::new(line.to_owned(), offset, centred.clone());
                chart.draw_series([EmptyElement::at((group_ix as f64 + 0.5, bottom)) + label])?;
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 13))
            .draw()?;
        area.present()?;
        Ok(())
    }

    /// Returns the left and the right end of a bar, in widths of a group.
    fn bar(&self, group_ix: usize, series_ix: usize) -> (f64, f64) {
        let width = BARS_SHARE / self.series.len() as f64;
        let left = group_ix as f64 + (1.0 - BARS_SHARE) / 2.0 + series_ix as f64 * width;
        (left, left + width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(scale: Scale, values: [[Option<f64>; 3]; 2]) -> BarChart {
        let series = |name: &str, values: [Option<f64>; 3]| Series { name: name.to_owned(), values: values.to_vec() };
        BarChart {
            title: "a < b & c".to_owned(),
            unit: "Mrays/s".to_owned(),
            scale,
            groups: ["one", "two\nlines", "three"].map(str::to_owned).to_vec(),
            series: vec![series("mask", values[0]), series("stack", values[1])],
        }
    }

    /// Returns the heights of a series' bars in pixels: all rectangles of its colour except the legend's.
    fn heights(svg: &str, series_ix: usize) -> Vec<f64> {
        let RGBColor(r, g, b) = COLOURS[series_ix];
        let colour = format!("#{r:02X}{g:02X}{b:02X}");
        let bars = svg.split("<rect ").filter(|element| element.contains(&colour));
        let height = |element: &str| element.split("height=\"").nth(1)?.split('"').next()?.parse().ok();
        let mut heights: Vec<f64> = bars.filter_map(height).collect();
        heights.pop();
        heights
    }

    #[test]
    fn everything_is_named_and_escaped() {
        let svg = chart(Scale::Linear, [[Some(1.0); 3], [Some(2.0); 3]]).svg();
        for word in ["mask", "stack", "one", "two", "lines", "three", "Mrays/s", "a &lt; b &amp; c"] {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn bars_are_as_long_as_their_values() {
        let svg = chart(Scale::Linear, [[Some(100.0), Some(50.0), None], [Some(25.0), None, Some(0.0)]]).svg();
        let (mask, stack) = (heights(&svg, 0), heights(&svg, 1));
        assert_eq!((mask.len(), stack.len()), (2, 1));
        assert!((mask[1] / mask[0] - 0.5).abs() < 0.02 && (stack[0] / mask[0] - 0.25).abs() < 0.02);
    }

    #[test]
    fn a_factor_of_ten_is_a_step_on_the_logarithmic_scale() {
        let svg = chart(Scale::Logarithmic, [[Some(2.0), Some(20.0), Some(200.0)], [None; 3]]).svg();
        let [a, b, c] = heights(&svg, 0)[..] else { panic!("three bars") };
        assert!(((c - b) - (b - a)).abs() <= 2.0, "{a} {b} {c}");
    }

    #[test]
    fn nothing_measured_is_an_empty_chart() {
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let empty = BarChart { groups: Vec::new(), ..chart(scale, [[None; 3]; 2]) };
            assert!(empty.svg().contains("</svg>") && chart(scale, [[None; 3]; 2]).svg().contains("</svg>"));
        }
    }
}
