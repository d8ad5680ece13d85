#![allow(missing_docs, clippy::unwrap_used)]
use palpate_physics::{Model, Scratch, State, TickInput, step};
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let scene = palpate_scene::load_file(std::path::Path::new(&path), &palpate_scene::Limits::local(), &mut |_, _| {}).unwrap();
    let model = Model::build(scene.model.clone()).unwrap();
    let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
    println!("of cells {:?}", model.body().as_hybrid().map(|h| (0..h.skin_rest_m().len() as u32).map(|v| h.vertex_point(v).amplification()).fold(1.0, f64::max)));
    println!("model substeps {} omega {}", model.substeps(), model.body().max_natural_frequency_rad_per_s());
    let t0 = std::time::Instant::now();
    for tick in 1..=1000u32 {
        let time = f64::from(tick) * 1e-3;
        let tools: Vec<_> = (0..model.tools().len()).map(|t| scene.offline_target(t, time)).collect();
        let input = TickInput { tools: &tools, load_factors: &[], prescribed_displacements_m: &vec![glam::DVec3::ZERO; model.prescribed().len()], point_forces: &[] };
        let r = step(&model, &mut state, &mut scratch, &input);
        if tick % 20 == 0 { println!("{tick} sub {} rep {} {:?} {:?}", r.substeps, r.repeated, scratch.meeting_walls(), t0.elapsed()); }
        if t0.elapsed().as_secs() > 100 { break; }
    }
}
