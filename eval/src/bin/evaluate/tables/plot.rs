//! Line plots as SVG: small, and sharp at any size.

use std::fmt::Write;

/// A line with its name.
pub struct Line {
    pub label: String,
    pub points: Vec<(f64, f64)>,
}

/// Axes.
pub struct Axes<'a> {
    pub title: &'a str,
    pub x: &'a str,
    pub y: &'a str,
    pub x_range: (f64, f64),
    pub y_range: (f64, f64),
}

/// Size of the picture and of its margins, pixels: left, top, right, bottom.
const SIZE: (f64, f64) = (720.0, 400.0);
const MARGINS: (f64, f64, f64, f64) = (60.0, 36.0, 200.0, 48.0);
/// Told apart by those who see few colours (Okabe and Ito).
const COLOURS: [&str; 7] = ["#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#000000"];
const TICKS: u32 = 5;

/// Draws lines.
pub fn svg(axes: &Axes<'_>, lines: &[Line]) -> String {
    let (left, top, right, bottom) = MARGINS;
    let (width, height) = (SIZE.0 - left - right, SIZE.1 - top - bottom);
    let share = |value: f64, (low, high): (f64, f64)| ((value - low) / (high - low).max(1e-9)).clamp(0.0, 1.0);
    let x_of = |value: f64| left + share(value, axes.x_range) * width;
    let y_of = |value: f64| top + (1.0 - share(value, axes.y_range)) * height;
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {} {}" font-family="sans-serif" font-size="12">
<rect width="100%" height="100%" fill="white"/>
<text x="{left}" y="22" font-size="14">{}</text>
"#,
        SIZE.0,
        SIZE.1,
        escape(axes.title)
    );
    // Writing to a string cannot fail.
    let mut put = |text: std::fmt::Arguments<'_>| svg.write_fmt(text).unwrap_or_default();
    for tick in 0..=TICKS {
        let part = f64::from(tick) / f64::from(TICKS);
        let at = |(low, high): (f64, f64)| low + part * (high - low);
        let (x, y) = (at(axes.x_range), at(axes.y_range));
        let (px, py, base) = (x_of(x), y_of(y), top + height);
        put(format_args!(
            r##"<path d="M{px:.1} {top}V{base}M{left} {py:.1}h{width}" stroke="#ddd" fill="none"/>
<text x="{px:.1}" y="{:.1}" text-anchor="middle">{}</text>
<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>
"##,
            base + 16.0,
            trimmed(x),
            left - 6.0,
            py + 4.0,
            trimmed(y)
        ));
    }
    for (index, line) in lines.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let points: Vec<String> = line.points.iter().map(|&(x, y)| format!("{:.1},{:.1}", x_of(x), y_of(y))).collect();
        let row = top + 14.0 + 18.0 * index as f64;
        let (dash, label) = (SIZE.0 - right + 12.0, SIZE.0 - right + 40.0);
        put(format_args!(
            r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="2"/>
<path d="M{dash} {row}h20" stroke="{colour}" stroke-width="2"/><text x="{label}" y="{}">{}</text>
"#,
            points.join(" "),
            row + 4.0,
            escape(&line.label)
        ));
    }
    let (middle, side) = (left + width / 2.0, top + height / 2.0);
    put(format_args!(
        r#"<text x="{middle}" y="{}" text-anchor="middle">{}</text>
<text x="16" y="{side}" text-anchor="middle" transform="rotate(-90 16 {side})">{}</text>
</svg>
"#,
        SIZE.1 - 12.0,
        escape(axes.x),
        escape(axes.y)
    ));
    svg
}

/// The share of `all` that is at most each value: steps from 0.
pub fn steps(mut values: Vec<f64>, all: usize, end: f64) -> Vec<(f64, f64)> {
    values.sort_by(f64::total_cmp);
    let share = |count: usize| count as f64 / all.max(1) as f64;
    let mut points = vec![(f64::MIN, 0.0)];
    for (index, value) in values.iter().enumerate() {
        points.extend([(*value, share(index)), (*value, share(index + 1))]);
    }
    points.push((end, share(values.len())));
    points
}

fn trimmed(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_grows_in_steps_and_the_picture_is_well_formed() {
        let points = steps(vec![3.0, 1.0], 4, 10.0);
        assert_eq!(points[1..], [(1.0, 0.0), (1.0, 0.25), (3.0, 0.25), (3.0, 0.5), (10.0, 0.5)]);
        let axes = Axes { title: "a < b", x: "m", y: "share", x_range: (0.0, 10.0), y_range: (0.0, 1.0) };
        let svg = svg(&axes, &[Line { label: "ours & theirs".to_owned(), points }]);
        assert!(svg.contains("a &lt; b") && svg.contains("&amp;") && svg.trim_end().ends_with("</svg>"));
        assert!(!svg.contains("inf") && !svg.contains("NaN"), "{svg}");
    }
}
