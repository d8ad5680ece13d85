//! A surface that stands alone, open or closed: welded where it is loose, turned where it is inside out. Holes and
//! parts stay.
use super::{Repairs, Soup, edges_of, manifold, weld};
use crate::places::same_place;
use glam::DVec3;
use palpate_physics::contact::is_inside;

/// Points on open edges are one point when they are nearer than this part of the shortest edge: texts of few digits
/// round farther than numbers in single precision, and a slit so narrow is none.
const LOOSE: f64 = 0.01;

/// A surface (m) after what was wrong with it is mended.
#[derive(Debug)]
pub(crate) struct Mended {
    pub(crate) points: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) repairs: Repairs,
    /// Triangles turned because the closed part that they belong to was inside out; they are not among `repairs`.
    pub(crate) inside_out: usize,
}

/// Mends a surface. What nothing is wrong with keeps its points and triangles as they are, and their numbers.
pub(crate) fn mend(points: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Mended {
    let mut repairs = Repairs::default();
    let is_sound = |v: &u32| points.get(*v as usize).is_some_and(|p| p.is_finite());
    if !triangles.iter().flatten().all(is_sound) {
        return Mended { points, triangles, repairs, inside_out: 0 };
    }
    let mut soup = welded(points, triangles, &mut repairs);
    let mut turned = soup.clone();
    let mut turning = repairs;
    // What has no two sides is refused later, with its place.
    if manifold::orient("", &mut turned, &mut turning).is_ok() {
        (soup, repairs) = (turned, turning);
    }
    let inside_out = turn_closed_parts(&mut soup);
    Mended { points: soup.points, triangles: soup.triangles, repairs, inside_out }
}

/// Welds points of open edges. Others are not looked at: two closed parts may touch.
fn welded(points: Vec<DVec3>, triangles: Vec<[u32; 3]>, repairs: &mut Repairs) -> Soup {
    let mut is_open = vec![false; points.len()];
    let edges = edges_of(&triangles);
    for &[a, b] in edges.iter().filter(|(_, owners)| owners.len() == 1).map(|(edge, _)| edge) {
        is_open[a as usize] = true;
        is_open[b as usize] = true;
    }
    let least = same_place(&points);
    let lengths = edges.keys().map(|&[a, b]| points[a as usize].distance(points[b as usize]));
    let shortest = lengths.filter(|length| *length > least).fold(f64::INFINITY, f64::min);
    let tolerance = if shortest.is_finite() { least.max(LOOSE * shortest) } else { least };
    let mut found = *repairs;
    let soup = weld::weld(&points, &triangles, tolerance, |v| is_open[v as usize], &mut found);
    if found.welded_points == 0 {
        return Soup { points, triangles };
    }
    *repairs = found;
    soup
}

/// A part of a surface that is closed.
struct ClosedPart {
    triangles: Vec<usize>,
    /// Signed volume: below zero where normals point inwards.
    volume: f64,
    low: DVec3,
    high: DVec3,
}

/// Turns closed parts whose normals point inwards, or, of those within another, outwards: a hollow's do. Returns how
/// many triangles were turned.
fn turn_closed_parts(soup: &mut Soup) -> usize {
    let parts = closed_parts(soup);
    let corners_of = |part: &ClosedPart| part.triangles.iter().map(|&t| soup.triangles[t]).collect::<Vec<_>>();
    let is_wrong = |part: &&ClosedPart| {
        let at = soup.points[soup.triangles[part.triangles[0]][0] as usize];
        let holds = |other: &&ClosedPart| {
            let boxed = at.cmpgt(other.low).all() && at.cmplt(other.high).all();
            !std::ptr::eq(*other, *part) && boxed && is_inside(at, &corners_of(other), &soup.points)
        };
        let around = parts.iter().filter(holds).count();
        part.volume < 0.0 && around % 2 == 0 || part.volume > 0.0 && around % 2 == 1
    };
    let wrong: Vec<usize> = parts.iter().filter(is_wrong).flat_map(|part| part.triangles.iter().copied()).collect();
    for &t in &wrong {
        soup.triangles[t].swap(1, 2);
    }
    wrong.len()
}

fn closed_parts(soup: &Soup) -> Vec<ClosedPart> {
    let part_of = manifold::parts(&soup.triangles);
    let count = part_of.iter().max().map_or(0, |last| last + 1);
    let mut is_closed = vec![true; count];
    for owners in edges_of(&soup.triangles).values().filter(|owners| owners.len() != 2) {
        for &t in owners {
            is_closed[part_of[t as usize]] = false;
        }
    }
    let new = || ClosedPart { triangles: Vec::new(), volume: 0.0, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
    let mut parts: Vec<ClosedPart> = (0..count).map(|_| new()).collect();
    for (t, corners) in soup.triangles.iter().enumerate() {
        let part = &mut parts[part_of[t]];
        // From a corner of the part: far from the origin, sums of large volumes would round.
        let first = part.triangles.first().map_or(corners[0], |&t| soup.triangles[t][0]);
        let [a, b, c] = corners.map(|v| soup.points[v as usize] - soup.points[first as usize]);
        part.volume += a.dot(b.cross(c)) / 6.0;
        for v in corners {
            part.low = part.low.min(soup.points[*v as usize]);
            part.high = part.high.max(soup.points[*v as usize]);
        }
        part.triangles.push(t);
    }
    let mut closed = is_closed.into_iter();
    parts.retain(|_| closed.next() == Some(true));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fill::samples::{Noise, Sample};

    fn ball(radius: f64, middle: DVec3) -> Sample {
        Sample::icosphere(DVec3::splat(radius), None, 1, 1.0).moved(|p| p + middle)
    }

    fn inside_out(mut sample: Sample) -> Sample {
        sample.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        sample
    }

    fn together(mut one: Sample, other: Sample) -> Sample {
        let first = one.points.len() as u32;
        one.points.extend(other.points);
        one.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        one
    }

    fn mended(sample: Sample) -> Mended {
        mend(sample.points, sample.triangles)
    }

    /// A sound surface must not be touched: its numbers are those of regions, tables and hashes.
    #[test]
    fn a_sound_surface_keeps_its_numbers() {
        let open = Sample::lat_long(DVec3::splat(10.0), Some(5.0), 8, 12);
        let hollow = together(ball(10.0, DVec3::ZERO), inside_out(ball(5.0, DVec3::X)));
        // Opposite points of the two lie at one place.
        let touching = together(ball(10.0, DVec3::ZERO), ball(10.0, 2.0 * ball(10.0, DVec3::ZERO).points[0]));
        for sample in [open.clone(), inside_out(open), hollow, touching] {
            let found = mended(sample.clone());
            assert_eq!((found.points, found.triangles), (sample.points, sample.triangles));
            assert_eq!((found.repairs, found.inside_out), (Repairs::default(), 0));
        }
    }

    /// Loose triangles by split vertices, and by rounding to a ten-thousandth of an edge.
    #[test]
    fn loose_triangles_are_welded() {
        for rough in [0.0, 5e-4] {
            let mut noise = Noise::new(3);
            let found = mended(ball(10.0, DVec3::ZERO).soup().moved(|p| p + noise.vector() * rough));
            assert_eq!((found.points.len(), found.triangles.len()), (42, 80));
            assert_eq!(found.repairs.welded_points, 240 - 42);
            assert!(edges_of(&found.triangles).values().all(|owners| owners.len() == 2));
        }
    }

    #[test]
    fn closed_parts_are_turned_to_the_side_that_is_outside() {
        let good = together(ball(10.0, DVec3::ZERO), ball(3.0, DVec3::X * 20.0));
        let bad = together(ball(10.0, DVec3::ZERO), inside_out(ball(3.0, DVec3::X * 20.0)));
        let found = mended(bad);
        assert_eq!(found.inside_out, 80);
        assert_eq!(found.triangles, mended(good).triangles);
        // A hollow whose normals point into the wall.
        let found = mended(together(ball(10.0, DVec3::ZERO), ball(5.0, DVec3::ZERO)));
        assert_eq!(found.inside_out, 80);
        // One triangle against its neighbours.
        let mut one = ball(10.0, DVec3::ZERO);
        one.triangles[7].swap(0, 1);
        let found = mended(one);
        assert_eq!((found.repairs.turned_triangles, found.inside_out), (1, 0));
    }
}
