//! Legend and title, in an 8×8 bitmap font.
use super::{
    colour::{Rgb, of_fraction},
    raster::Canvas,
};
use font8x8::UnicodeFonts as _;

const GLYPH: usize = 8;
const MARGIN: usize = 16;
const BAR_WIDTH: usize = 16;
const TICKS: usize = 4;

/// Colours over displacement in mm, at the left edge, with remarks below.
pub(super) fn legend(canvas: &mut Canvas, top_m: f32, remarks: &[&str], ink: Rgb) {
    let scale = text_scale(canvas);
    let height = canvas.height / 3;
    let top = canvas.height / 2 - height / 2;
    for row in 0..height {
        let colour = of_fraction(1.0 - row as f32 / (height - 1) as f32);
        for column in 0..BAR_WIDTH * scale {
            canvas.paint(MARGIN + column, top + row, colour);
        }
    }
    for tick in 0..=TICKS {
        let fraction = 1.0 - tick as f32 / TICKS as f32;
        let row = top + tick * (height - 1) / TICKS;
        let text = trimmed(1e3 * top_m * fraction);
        write(canvas, MARGIN + BAR_WIDTH * scale + 6, row - GLYPH * scale / 2, &text, scale, ink);
    }
    write(canvas, MARGIN, top - 2 * GLYPH * scale, "displacement / mm", scale, ink);
    for (line, remark) in remarks.iter().enumerate() {
        write(canvas, MARGIN, top + height + (3 * line + 2) * GLYPH * scale / 2, remark, scale, ink);
    }
}

/// Scene and simulated time, at the top left.
pub(super) fn title(canvas: &mut Canvas, scene: &str, time_s: f64, ink: Rgb) {
    let scale = text_scale(canvas);
    write(canvas, MARGIN, MARGIN, &format!("{scene}  t = {time_s:.3} s"), scale, ink);
}

/// What the arrow of one tool stands for, in its colour, below the title.
pub(super) fn force(canvas: &mut Canvas, line: usize, tool: &str, force_n: f32, ink: Rgb) {
    let scale = text_scale(canvas);
    let top = MARGIN + (line + 1) * 2 * GLYPH * scale;
    write(canvas, MARGIN, top, &format!("contact force on {tool} {force_n:.3} N"), scale, ink);
}

fn text_scale(canvas: &Canvas) -> usize {
    (canvas.height / 400).clamp(1, 6)
}

/// Three significant digits without trailing zeros.
pub(super) fn trimmed(value: f32) -> String {
    let decimals = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).max(0) as usize };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn write(canvas: &mut Canvas, left: usize, top: usize, text: &str, scale: usize, ink: Rgb) {
    for (index, character) in text.chars().enumerate() {
        let Some(glyph) = font8x8::BASIC_FONTS.get(character) else { continue };
        for (row, bits) in glyph.iter().enumerate() {
            for column in (0..GLYPH).filter(|column| bits >> column & 1 == 1) {
                for (dx, dy) in (0..scale).flat_map(|dx| (0..scale).map(move |dy| (dx, dy))) {
                    canvas.paint(left + (index * GLYPH + column) * scale + dx, top + row * scale + dy, ink);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_short() {
        for (value, text) in [(0.0, "0"), (5.0, "5"), (1.25, "1.25"), (0.375, "0.375"), (0.05, "0.05"), (100.0, "100")]
        {
            assert_eq!(trimmed(value), text);
        }
    }
}
