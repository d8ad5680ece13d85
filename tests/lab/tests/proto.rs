#![allow(clippy::unwrap_used)]
mod hybrid_body;
use hybrid_body::{Case, error, problem};
#[test]
fn proto() {
    let v = |n: &str| std::env::var(n).unwrap();
    let nums = |n: &str| -> Vec<f64> { v(n).split(',').map(|x| x.parse().unwrap()).collect() };
    for p in v("PROBLEMS").split(',') {
        for h in nums("SPACINGS") {
            for a in nums("ACTIVE") {
                let (c, s) = if p.starts_with("block") { (4, 32) } else { (400, 150_000) };
                let case = Case {
                    name: format!("h {h}"),
                    coarse_tets: c,
                    skin_tets: s,
                    spacing_m: h * 1e-3,
                    active: a as usize,
                    points: None,
                    places: None,
                };
                let _ = error(&problem(p), &case);
            }
        }
    }
}
