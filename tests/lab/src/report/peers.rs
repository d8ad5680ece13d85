//! Peers beside our methods at equal error: the page's section and the lines a run prints.
//!
//! An error against the reference has two parts here: the mesh's, which linear tetrahedra share, and the solver's own. A solver that is too
//! soft makes up for a mesh that is too stiff, and then the two cancel. So a peer is compared in two ways: on the same mesh, if it solved
//! that mesh's equations ([`SOLVED`]), and against the reference, whatever the reason of its nearness.
use super::page::{escape, number, percent};
use crate::{
    measure::{Row, Run, TIE_ERROR},
    methods,
    peers::PREFIX,
};
use std::fmt::Write as _;

/// A peer has solved a mesh's equations if its answer is this near to our linear tets' on that mesh, which is their equilibrium. Laws that
/// are alike to first order differ by up to half of this on the problems that peers are given.
const SOLVED: f64 = 0.02;

/// A peer's row beside ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beside<'a> {
    pub peer: &'a Row,
    /// How far its answer is from the mesh's equilibrium.
    pub off_mesh: Option<f64>,
    /// The fastest of ours that solved the same mesh's equations, if the peer did.
    pub on_mesh: Option<&'a Row>,
    /// Our linear tets on that mesh, if the peer solved its equations.
    pub tets_on_mesh: Option<&'a Row>,
    /// The fastest of ours, at any resolution, that is no farther from the reference.
    pub as_near: Option<&'a Row>,
}

impl Beside<'_> {
    fn times_less(&self, ours: Option<&Row>) -> Option<f64> {
        Some(self.peer.median_us? / ours?.median_us?)
    }
}

fn time_us(row: &Row) -> f64 {
    row.median_us.unwrap_or(f64::INFINITY)
}

fn fastest<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    rows.filter(|row| row.median_us.is_some()).min_by(|a, b| time_us(a).total_cmp(&time_us(b)))
}

/// Every row of peers that has an answer and times.
pub(super) fn beside(rows: &[Row]) -> Vec<Beside<'_>> {
    let measured = |row: &&Row| row.error().is_some() && row.median_us.is_some();
    let (peers, ours): (Vec<&Row>, Vec<&Row>) =
        rows.iter().filter(measured).partition(|row| row.method.starts_with(PREFIX));
    peers.into_iter().map(|peer| of(peer, &ours)).collect()
}

fn of<'a>(peer: &'a Row, ours: &[&'a Row]) -> Beside<'a> {
    let competing = || ours.iter().copied().filter(|row| row.problem == peer.problem && row.competes);
    let same_mesh = || competing().filter(|row| row.resolution == peer.resolution);
    let tets = same_mesh().find(|row| row.method == methods::LINEAR_TETS);
    let equilibrium = tets.and_then(|row| row.answer);
    let off = |row: &Row| Some(row.answer? / equilibrium? - 1.0);
    let solved = |row: &Row| off(row).is_some_and(|off| off.abs() <= SOLVED);
    let error = peer.error().unwrap_or(0.0);
    let near = competing().filter(|row| row.error().is_some_and(|e| e <= (1.0 + TIE_ERROR) * error));
    Beside {
        peer,
        off_mesh: off(peer),
        tets_on_mesh: tets.filter(|_| solved(peer)),
        on_mesh: if solved(peer) { fastest(same_mesh().filter(|row| solved(row))) } else { None },
        as_near: fastest(near),
    }
}

/// Per problem and resolution the fastest peer that solved the mesh's equations beside ours, a sentence each.
pub(super) fn sentences(rows: &[Row]) -> Vec<String> {
    let solved: Vec<Beside<'_>> = beside(rows).into_iter().filter(|b| b.on_mesh.is_some()).collect();
    let same =
        |a: &Beside<'_>, b: &Beside<'_>| a.peer.problem == b.peer.problem && a.peer.resolution == b.peer.resolution;
    let first = |b: &&Beside<'_>| solved.iter().all(|o| !same(o, b) || time_us(o.peer) >= time_us(b.peer));
    solved.iter().filter(first).filter_map(sentence).collect()
}

fn sentence(b: &Beside<'_>) -> Option<String> {
    let (ours, tets) = (b.on_mesh?, b.tets_on_mesh?);
    Some(format!(
        "{} at {}: the fastest peer that solves the mesh's equations is {} with {} µs a tick (error {}, {} off the mesh's equilibrium); {} \
         takes {} µs (error {}): {:.1} times less; {} {} µs: {:.1} times less",
        b.peer.problem,
        b.peer.resolution,
        b.peer.method.trim_start_matches(PREFIX),
        number(b.peer.median_us, 1),
        percent(b.peer.answer_error),
        percent(b.off_mesh),
        ours.method,
        number(ours.median_us, 1),
        percent(ours.answer_error),
        b.times_less(Some(ours))?,
        tets.method,
        number(tets.median_us, 1),
        b.times_less(Some(tets))?
    ))
}

/// The section; nothing if the run had no peers.
pub(super) fn section(out: &mut String, run: &Run) {
    let notes: Vec<_> = run.circumstances.iter().filter(|(key, _)| key.starts_with(PREFIX)).collect();
    if notes.is_empty() {
        return;
    }
    out.push_str(
        "<h2>Peers</h2><p>Other people's simulators on the same meshes, masses and nodal forces, one thread each, through their Python \
         packages. They run in processes of their own, so that they and our methods took turns in ten blocks rather than tick by tick; \
         within a block a turn is again one untimed tick and one timed. Only the call that steps their simulation is timed: loads and mass \
         damping are set outside it. They are timed under the same tremor. Only dead loads are given to them: \
         what a sphere feels would measure how soft their contact is set, for neither has contact as an unyielding surface.</p><p>Where a \
         peer's law is not the problem's its points are hollow. At small strain all these laws are Hooke's, so that the difference is of the \
         order of the strain. Linear tetrahedra are alike for all: on the same mesh a converged peer has our error.</p>\
         <table class=\"text\"><tr><th>peer</th><th>version, settings, law</th></tr>",
    );
    for (key, value) in &notes {
        let _ = write!(out, "<tr><td>{}</td><td>{}</td></tr>", escape(key.trim_start_matches(PREFIX)), escape(value));
    }
    out.push_str(
        "</table><h3>At equal error</h3><p>The error against the reference has two parts: the mesh's, which all linear tetrahedra share, and the \
         solver's own. Linear tetrahedra are too stiff; a solver whose steps are too long is too soft, and the two cancel. So peers are \
         compared twice. <b>On the same mesh</b>, where a peer solved that mesh's equations (its answer is within 2 % of their equilibrium, \
         which leaves room for its law): both then have the mesh's error. <b>Against the reference</b>, with the fastest competing one of \
         ours at any resolution that is no farther from it, whatever the reason: where a peer is near because errors cancel, that is what \
         it takes us to be as near by resolution.</p><ul>",
    );
    for sentence in sentences(&run.rows) {
        let _ = write!(out, "<li>{}</li>", escape(&sentence));
    }
    out.push_str(
        "</ul><div class=\"wide\"><table><tr><th>problem</th><th>peer</th><th>at</th><th>steps</th><th>µs</th><th>error</th>\
         <th>off the mesh's equilibrium</th><th>our fastest on this mesh, µs</th><th>times less</th><th>our linear tets, µs</th><th>times less</th>\
         <th>ours as near, at</th><th>µs</th><th>times less</th></tr>",
    );
    for b in beside(&run.rows) {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
            escape(&b.peer.problem),
            escape(b.peer.method.trim_start_matches(PREFIX)),
            b.peer.resolution,
            b.peer.substeps,
            number(b.peer.median_us, 1),
            percent(b.peer.answer_error),
            percent(b.off_mesh),
            number(b.on_mesh.and_then(|row| row.median_us), 1),
            number(b.times_less(b.on_mesh), 1),
            number(b.tets_on_mesh.and_then(|row| row.median_us), 1),
            number(b.times_less(b.tets_on_mesh), 1)
        );
        let _ = match b.as_near {
            Some(ours) => write!(
                out,
                "<td>{} at {}</td><td>{}</td><td>{}</td></tr>",
                escape(&ours.method),
                ours.resolution,
                number(ours.median_us, 1),
                number(b.times_less(b.as_near), 1)
            ),
            None => write!(out, "<td colspan=\"3\">nothing of ours is as near</td></tr>"),
        };
    }
    out.push_str("</table></div>");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, resolution: u32, time_us: f64, error: f64) -> Row {
        Row {
            problem: "p".into(),
            method: method.into(),
            competes: true,
            resolution,
            median_us: Some(time_us),
            answer: Some(1.0 + error),
            answer_error: Some(error),
            ..Row::default()
        }
    }

    #[test]
    fn a_peer_is_compared_on_its_mesh_and_against_the_reference() {
        let rows = [
            row(methods::LINEAR_TETS, 1, 10.0, -0.5),
            row(methods::LINEAR_TETS, 2, 40.0, -0.2),
            row("slow", 2, 80.0, -0.199),
            row("quick", 2, 20.0, -0.2),
            Row { competes: false, ..row("unfair", 1, 1.0, 0.0) },
            row("peer: a", 2, 400.0, -0.201),
            row("peer: b", 2, 600.0, -0.19),
            row("peer: soft", 2, 20.0, -0.1),
            row("peer: softer", 2, 30.0, 0.6),
        ];
        let all = beside(&rows);
        let on_mesh: Vec<_> = all.iter().map(|b| b.times_less(b.on_mesh)).collect();
        assert_eq!(on_mesh, [Some(20.0), Some(30.0), None, None]);
        let tets: Vec<_> = all.iter().map(|b| b.times_less(b.tets_on_mesh)).collect();
        assert_eq!(tets, [Some(10.0), Some(15.0), None, None]);
        let as_near: Vec<_> = all.iter().map(|b| b.times_less(b.as_near)).collect();
        assert_eq!(as_near, [Some(20.0), None, None, Some(3.0)]);
        let lines = sentences(&rows);
        assert!(
            lines.len() == 1
                && lines[0].contains("is a with")
                && lines[0].contains("20.0 times less; ")
                && lines[0].ends_with("10.0 times less"),
            "{lines:?}"
        );
    }

    #[test]
    fn a_run_without_peers_has_no_section_and_a_skipped_one_is_told() {
        let mut out = String::new();
        section(&mut out, &Run::default());
        assert!(out.is_empty());
        let note = ("peer: X".to_owned(), "skipped: no <python>".to_owned());
        section(&mut out, &Run { circumstances: [note].into(), rows: vec![] });
        assert!(out.contains("skipped: no &lt;python&gt;"));
    }
}
