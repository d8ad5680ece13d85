//! The session survives the process: kept while it runs, when it stops and before another scene is loaded, and taken up again bit for bit.
use crate::common::{Daemon, PATIENCE, block_scene, pressed_scene};
use palpate_proto::v1::{self, load_scene_request::Source as WireSource};
use palpated::{
    kept::{
        autosave::AutosaveSettings,
        folder::{Kept, KeptFolder, Slot, Source},
    },
    serve::{ServeConfig, ServeError, start},
};
use std::{path::Path, time::Duration};
use tokio_util::sync::CancellationToken;

fn config(folder: &Path, every: Duration, resume: Option<Kept>) -> ServeConfig {
    ServeConfig {
        source: Some(Source::Named("pressed".into())),
        autosave: Some(AutosaveSettings { folder: KeptFolder::at(folder), every }),
        resume,
        ..ServeConfig::in_process()
    }
}

const NEVER: Duration = Duration::from_hours(1);

/// What runs on after a stop is what would have run on without it.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_goes_on_where_the_daemon_stopped() {
    let place = tempfile::tempdir().unwrap();
    let kept_in = KeptFolder::at(place.path());
    let daemon = Daemon::with(pressed_scene(3), config(place.path(), NEVER, None)).await;
    daemon.pause().await;
    daemon.step(150).await;
    let before = daemon.snapshot().await;
    assert_eq!(daemon.status().await.autosave_age_s, None);
    daemon.finish().await;
    let kept = kept_in.read(Slot::Newest).unwrap().expect("it is kept when the daemon stops");
    assert_eq!((kept.tick, kept.state_hash, kept.paused), (before.tick, before.state_hash, true));
    assert_eq!(kept.state, before.state);

    let daemon = Daemon::with(pressed_scene(3), config(place.path(), NEVER, Some(kept))).await;
    let again = daemon.snapshot().await;
    assert_eq!((again.tick, again.state_hash), (before.tick, before.state_hash), "time stands as it stood");
    daemon.step(150).await;
    let gone_on = daemon.snapshot().await;
    daemon.finish().await;

    let other = Daemon::on(pressed_scene(3)).await;
    other.pause().await;
    let restore = v1::RestoreRequest { state: before.state, ..Default::default() };
    other.session().restore(restore).await.unwrap();
    other.step(150).await;
    assert_eq!(other.snapshot().await.state_hash, gone_on.state_hash);
    other.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_is_kept_from_time_to_time_and_before_another_takes_its_place() {
    let place = tempfile::tempdir().unwrap();
    let kept_in = KeptFolder::at(place.path());
    let daemon = Daemon::with(pressed_scene(2), config(place.path(), Duration::from_millis(50), None)).await;
    let until = tokio::time::Instant::now() + PATIENCE;
    let mut ticks = Vec::new();
    while ticks.len() < 3 {
        if let Some(kept) = kept_in.read(Slot::Newest).unwrap_or_default()
            && ticks.last() != Some(&kept.tick)
        {
            ticks.push(kept.tick);
        }
        assert!(tokio::time::Instant::now() < until, "{ticks:?}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert!(ticks.is_sorted() && daemon.status().await.autosave_age_s.unwrap() < 20.0, "{ticks:?}");
    let load = |source| v1::LoadSceneRequest { source: Some(source) };
    let text = "[scene]\nname = \"small\"\n[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n[[material]]\nlaw = \"stvk\"\n\
                young_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
    let before = daemon.status().await.tick;
    daemon.session().load_scene(load(WireSource::Toml(text.into()))).await.unwrap();
    let replaced = kept_in.read(Slot::Replaced).unwrap().expect("it is kept before another is loaded");
    assert!(replaced.tick >= before && replaced.source == Source::Named("pressed".into()), "{}", replaced.tick);
    daemon.finish().await;
    let newest = kept_in.read(Slot::Newest).unwrap().unwrap();
    assert_eq!(newest.source, Source::Text(text.into()));
    // It can be loaded, built and put there again.
    let scene = palpated::load::from_kept(&newest.source, &mut |_, _| ()).unwrap();
    let tick = newest.tick;
    let again = Daemon::with(scene, config(place.path(), NEVER, Some(newest))).await;
    assert!(again.status().await.tick >= tick);
    again.finish().await;
}

/// A broken body is no reason to lose the good one.
#[tokio::test(flavor = "multi_thread")]
async fn a_quarantined_state_takes_no_good_ones_place() {
    let place = tempfile::tempdir().unwrap();
    let daemon = Daemon::with(pressed_scene(4), config(place.path(), Duration::from_millis(20), None)).await;
    let until = tokio::time::Instant::now() + PATIENCE;
    while daemon.status().await.autosave_age_s.is_none() {
        assert!(tokio::time::Instant::now() < until);
    }
    daemon.break_the_body().await;
    let until = tokio::time::Instant::now() + PATIENCE;
    while daemon.status().await.quarantine.is_empty() {
        assert!(tokio::time::Instant::now() < until);
    }
    tokio::time::sleep(Duration::from_millis(100)).await;
    daemon.finish().await;
    let kept = KeptFolder::at(place.path()).read(Slot::Newest).unwrap();
    let kept = kept.expect("the good one is there");
    let again = Daemon::with(pressed_scene(4), config(place.path(), NEVER, Some(kept))).await;
    assert_eq!(again.status().await.quarantine, "");
    again.finish().await;
}

/// A kept session of another body was a daemon that did not start.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_of_the_scene_is_set_aside_and_the_scene_begins_at_rest() {
    for (scene, spoil) in [(block_scene("another", 3), 0), (pressed_scene(2), 1)] {
        let place = tempfile::tempdir().unwrap();
        let kept_in = KeptFolder::at(place.path());
        let daemon = Daemon::with(pressed_scene(2), config(place.path(), NEVER, None)).await;
        tokio::time::sleep(Duration::from_millis(50)).await;
        daemon.finish().await;
        let mut kept = kept_in.read(Slot::Newest).unwrap().unwrap();
        kept.state_hash ^= spoil;
        let began = Daemon::with(scene, config(place.path(), NEVER, Some(kept.clone()))).await;
        assert!(began.status().await.tick < kept.tick + 20, "it begins at rest");
        assert_eq!(kept_in.read(Slot::Newest).unwrap(), None);
        let aside = KeptFolder::at(&place.path().join("refused")).read(Slot::Newest).unwrap().unwrap();
        assert_eq!((aside.tick, aside.state), (kept.tick, kept.state), "nothing is lost");
        began.finish().await;
    }
    // Without a folder there is nowhere to set it aside.
    let bare = |resume| ServeConfig { resume, autosave: None, ..config(Path::new("nowhere"), NEVER, None) };
    let nonsense = Kept {
        source: Source::Named("pressed".into()),
        state: vec![7; 9],
        state_hash: 0,
        tick: 1,
        time_s: 0.0,
        paused: false,
    };
    let refused = start(bare(Some(nonsense)), pressed_scene(2), CancellationToken::new()).await.unwrap_err();
    assert!(matches!(refused, ServeError::Resume { .. }), "{refused:?}");
}
