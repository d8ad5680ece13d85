//! Compiles `palpate/v1/*.proto` to Rust without protoc, and keeps the descriptor set for reflection and the web page.
use std::{env, error::Error, fs, path::PathBuf};

const FILES: [&str; 4] =
    ["palpate/v1/common.proto", "palpate/v1/device.proto", "palpate/v1/surface.proto", "palpate/v1/session.proto"];

fn main() -> Result<(), Box<dyn Error>> {
    for file in FILES {
        println!("cargo:rerun-if-changed={file}");
    }
    let mut compiler = protox::Compiler::new(["."])?;
    compiler.include_source_info(true).include_imports(true).open_files(FILES)?;
    let out_dir = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out_dir.join("palpate_descriptor.bin"), compiler.encode_file_descriptor_set())?;
    tonic_prost_build::configure()
        .bytes(".palpate.v1.KeyframeChunk")
        .bytes(".palpate.v1.SurfaceUpdate")
        .bytes(".palpate.v1.Places")
        .bytes(".palpate.v1.RefinedSurface")
        .bytes(".palpate.v1.SnapshotResponse")
        .bytes(".palpate.v1.RestoreRequest")
        .compile_fds(compiler.file_descriptor_set())?;
    Ok(())
}
