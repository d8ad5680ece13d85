//! All cases, and what they come to.
use super::{
    names::FineMethod,
    setting::{CoarseMesh, Setting},
};
use crate::problems::{self, Problem, place::Place};
use miette::Result;

/// Numbers of active particles.
pub(super) const ACTIVE: [usize; 7] = [50, 100, 200, 400, 600, 1000, 1400];
const NU: [&str; 3] = ["0.30", "0.45", "0.49"];
/// Resolutions and spacing (m) of the block, and of the ventricle.
const BLOCK: (u32, u32, f64) = (4, 32, 2.5e-3);
const VENTRICLE: ([u32; 2], u32, f64) = ([188, 400], 150_000, 3.2e-3);

/// A body under a load.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) problem: Problem,
    pub(super) mesh: CoarseMesh,
    skin_tets: u32,
    spacing_m: f64,
}

/// What one method got wrong in one case.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    pub(super) problem: String,
    pub(super) mesh: &'static str,
    pub(super) coarse_tets: usize,
    pub(super) method: String,
    pub(super) active: usize,
    pub(super) points: usize,
    pub(super) answer_error: f64,
    pub(super) field_l2: f64,
    pub(super) field_max: f64,
}

/// Over all cases.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub(super) method: String,
    pub(super) active: usize,
    /// Median and largest of the answers' errors.
    pub(super) answer: [f64; 2],
    /// Median and largest of the fields', in L2.
    pub(super) field: [f64; 2],
    /// In how many cases it has the best field, and of how many.
    pub(super) nearest: [usize; 2],
}

impl Case {
    pub(super) fn all() -> Vec<Self> {
        let mut names: Vec<String> = NU.map(|nu| format!("block-patch-small-nu{nu}")).to_vec();
        names.push("block-patch-small-nu0.45-stvk".into());
        names.extend(NU.map(|nu| format!("ventricle-patch-small-nu{nu}")));
        let others = Place::ALL.into_iter().filter(|place| *place != Place::Side);
        names.extend(others.map(|place| format!("{}-patch-small-nu0.45", place.name())));
        let (_, skin_tets, spacing_m) = BLOCK;
        let block = |problem: &Problem| {
            let case = |mesh| Self { problem: problem.clone(), mesh, skin_tets, spacing_m };
            [CoarseMesh::Made(BLOCK.0), CoarseMesh::Shaken(BLOCK.0)].map(case)
        };
        let (coarse, skin_tets, spacing_m) = VENTRICLE;
        let ventricle = |problem: &Problem| {
            coarse.map(|tets| Self { problem: problem.clone(), mesh: CoarseMesh::Made(tets), skin_tets, spacing_m })
        };
        let all = problems::all();
        let found = names.iter().filter_map(|name| all.iter().find(|problem| problem.name == *name));
        found.flat_map(|p| if p.name.starts_with("block") { block(p) } else { ventricle(p) }).collect()
    }

    /// What the coarse mesh is like.
    pub(super) fn mesh_name(&self) -> &'static str {
        match self.mesh {
            CoarseMesh::Shaken(_) => "shaken",
            CoarseMesh::Made(_) if self.problem.name.starts_with("block") => "regular",
            CoarseMesh::Made(_) => "Delaunay",
        }
    }

    /// Every method at every number of active particles. `tell` is told after each.
    pub(super) fn run(&self, methods: &[FineMethod], active: &[usize], tell: &mut dyn FnMut()) -> Result<Vec<Row>> {
        let setting = Setting::new(self.problem.clone(), self.mesh, self.skin_tets, self.spacing_m)?;
        let mut rows = Vec::new();
        for method in methods {
            for &active in active {
                let errors = match method {
                    FineMethod::Cells => setting.errors(active, None, None)?,
                    FineMethod::Points(method) => {
                        setting.errors(active, Some(&|partition, active| method.points(partition, active)), None)?
                    }
                };
                rows.push(Row {
                    problem: self.problem.name.clone(),
                    mesh: self.mesh_name(),
                    coarse_tets: setting.coarse_tets(),
                    method: method.name(),
                    active,
                    points: errors.points,
                    answer_error: errors.answer,
                    field_l2: errors.field.l2,
                    field_max: errors.field.max,
                });
                tell();
            }
        }
        Ok(rows)
    }
}

/// One line a method and number, in the order of the rows.
pub(super) fn summaries(rows: &[Row]) -> Vec<Summary> {
    let mut summaries: Vec<Summary> = Vec::new();
    for row in rows {
        if summaries.iter().any(|s| s.method == row.method && s.active == row.active) {
            continue;
        }
        let own = || rows.iter().filter(|other| other.method == row.method && other.active == row.active);
        let beaten = |own: &&Row| {
            let rivals = rows.iter().filter(|other| other.is_rival_of(own));
            rivals.map(|rival| rival.field_l2).all(|rival| rival >= own.field_l2)
        };
        summaries.push(Summary {
            method: row.method.clone(),
            active: row.active,
            answer: median_and_largest(own().map(|row| row.answer_error.abs())),
            field: median_and_largest(own().map(|row| row.field_l2)),
            nearest: [own().filter(beaten).count(), own().count()],
        });
    }
    summaries
}

impl Row {
    /// Whether another row is of the same case and number.
    pub(super) fn is_rival_of(&self, other: &Self) -> bool {
        let case = |row: &Self| (row.problem.clone(), row.mesh, row.coarse_tets, row.active);
        case(self) == case(other) && self.method != other.method
    }
}

fn median_and_largest(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let median = match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    };
    [median, values.last().copied().unwrap_or(f64::NAN)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_all_cases() {
        let cases = Case::all();
        assert_eq!(cases.len(), 22);
        let of = |mesh: &str| cases.iter().filter(|case| case.mesh_name() == mesh).count();
        assert_eq!([of("regular"), of("shaken"), of("Delaunay")], [4, 4, 14]);
    }

    #[test]
    fn medians_are_over_cases_and_the_nearest_is_counted_case_by_case() {
        let row = |problem: &str, method: &str, field_l2: f64| Row {
            problem: problem.into(),
            mesh: "regular",
            coarse_tets: 192,
            method: method.into(),
            active: 600,
            points: 1,
            answer_error: -field_l2 / 2.0,
            field_l2,
            field_max: field_l2,
        };
        let rows = [row("a", "x", 0.1), row("a", "y", 0.2), row("b", "x", 0.4), row("b", "y", 0.3)];
        let found = summaries(&rows);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].nearest, found[1].nearest), ([1, 2], [1, 2]));
        assert!((found[0].field[0] - 0.25).abs() < 1e-15 && found[0].field[1] == 0.4);
        assert!((found[1].answer[0] - 0.125).abs() < 1e-15 && found[1].answer[1] == 0.15);
    }
}
