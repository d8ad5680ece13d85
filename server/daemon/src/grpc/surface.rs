//! `palpate.v1.Surface`.
use super::{convert, current_session};
use crate::{
    session::Daemon,
    sparing::Sparing,
    stream::{hub::MOST_VIEWERS, viewer::Viewer},
};
use futures_util::{Stream, stream};
use palpate_proto::v1::{self, surface_server::Surface};
use std::{pin::Pin, sync::Arc};
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub struct SurfaceService {
    /// Shared by all services.
    pub daemon: Arc<Daemon>,
    /// Its line of the log.
    pub said: Arc<Sparing>,
}

#[tonic::async_trait]
impl Surface for SurfaceService {
    type WatchStream = Pin<Box<dyn Stream<Item = Result<v1::SurfaceEvent, Status>> + Send>>;

    async fn watch(&self, request: Request<v1::WatchRequest>) -> Result<Response<Self::WatchStream>, Status> {
        let request = request.into_inner();
        current_session(&self.daemon, &request.session_id)?;
        let (rate_hz, layers) = convert::watch_request(&request, self.daemon.hub.display_rate_hz())?;
        let full = || Status::resource_exhausted(format!("{MOST_VIEWERS} viewers are watching: no more can"));
        let seat = self.daemon.hub.join(rate_hz, layers).ok_or_else(full)?;
        self.said
            .say(|times| tracing::info!(rate_hz, viewers = self.daemon.hub.viewer_count(), times, "a viewer has come"));
        let viewer = Viewer::new(seat, rate_hz, layers, self.daemon.stop.clone());
        let events = stream::unfold(viewer, |mut viewer| async move { viewer.next().await.map(|e| (Ok(e), viewer)) });
        Ok(Response::new(Box::pin(events)))
    }
}
