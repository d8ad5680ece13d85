//! A library in libHD's place: built once, and a copy of it for each arm, since a library is one in its process.
#![allow(dead_code, unreachable_pub, missing_docs, clippy::unwrap_used)] // helpers of tests; each file uses a part
use palpate_bridge::{
    config::PhantomConfig,
    emulate::phantom::{Phantom, Settings},
};
use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};
use tempfile::TempDir;

/// An arm, and the library that speaks to it.
pub struct Emulated {
    pub arm: Phantom,
    pub library: String,
    _folder: TempDir,
}

impl Emulated {
    pub fn new(settings: Settings) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libHD.so");
        std::fs::copy(built(), &library).unwrap();
        let arm = Phantom::listen(&folder.path().join("arm"), settings).unwrap();
        Self { arm, library: library.to_str().unwrap().to_owned(), _folder: folder }
    }

    pub fn keys(&self) -> PhantomConfig {
        PhantomConfig {
            library: self.library.clone(),
            name: self.arm.socket().to_str().unwrap().to_owned(),
            // Patient with a busy test machine.
            silence_s: 0.4,
            ..PhantomConfig::default()
        }
    }
}

/// In a folder of its own, where no other build waits for it.
pub fn built() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mock-libhd");
        let built = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "--locked", "--package", "palpate-mock-libhd", "--target-dir"])
            .arg(&folder)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env_remove("CARGO_BUILD_TARGET")
            .status();
        assert!(built.unwrap().success(), "cargo build --package palpate-mock-libhd");
        folder.join("debug/libpalpate_mock_hd.so")
    })
}
