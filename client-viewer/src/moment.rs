//! Which moment of the body `snapshot` and `export` take: the present one, or the first with enough force.
use crate::{
    ViewError,
    connect::Server,
    refined,
    surface::{Surface, Watcher, magnitude},
};
use clap::Args;
use palpate_proto::v1::WatchRequest;
use std::time::Duration;

/// The moment wanted.
#[derive(Debug, Clone, Copy, Args)]
pub struct Moment {
    /// Wait until the contact force on a tool is at least so large (N) [default: the present moment, whatever it is]
    #[arg(long, value_name = "N", value_parser = parse_positive, allow_negative_numbers = true)]
    min_force_n: Option<f64>,
    /// Longest wait for that force (s)
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = parse_positive, allow_negative_numbers = true)]
    timeout_s: f64,
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if number > 0.0 && number <= 1e9 { Ok(number) } else { Err("must be a positive number".into()) }
}

impl Moment {
    /// The surface at that moment, with the layers asked for (rate and detail are the daemon's).
    ///
    /// # Errors
    /// An unreachable daemon, a broken stream, or [`ViewError::NotPressed`].
    pub async fn surface(&self, server: &Server, request: WatchRequest) -> Result<Surface, ViewError> {
        let refined = request.refined_surface;
        let mut watcher = Watcher::ask(server.connect().await?, request).await?;
        let surface = self.wait(&mut watcher).await?;
        if refined { refined::merged(surface) } else { Ok(surface) }
    }

    async fn wait(&self, watcher: &mut Watcher) -> Result<Surface, ViewError> {
        let ended = || ViewError::Stream("ended before the surface that was waited for".into());
        let Some(wanted_n) = self.min_force_n else { return watcher.next().await?.cloned().ok_or_else(ended) };
        let mut largest_n: f64 = 0.0;
        let pressed = async {
            loop {
                let surface = watcher.next().await?.ok_or_else(ended)?;
                let forces_n = surface.last.tools.iter().map(|tool| magnitude(tool.contact_force_n.as_ref()));
                let force_n = forces_n.fold(0.0, f64::max);
                largest_n = largest_n.max(force_n);
                if force_n >= wanted_n {
                    return Ok(surface.clone());
                }
            }
        };
        let in_time = tokio::time::timeout(Duration::from_secs_f64(self.timeout_s), pressed).await;
        in_time.unwrap_or(Err(ViewError::NotPressed { wanted_n, waited_s: self.timeout_s, largest_n }))
    }
}
