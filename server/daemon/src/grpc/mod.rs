//! The services of `palpate.v1`, beside health, reflection and the page, on one port.
pub mod convert;
pub mod detach;
pub mod device;
pub mod downlink;
pub mod news;
pub mod session;
pub mod surface;
pub mod uplink;

use crate::{
    doors::{
        Routers,
        bounds::MAX_SMALL_BYTES,
        origin::{self, Guard},
        whole::{self, Gate},
    },
    metrics, page,
    session::{ActiveSession, Daemon},
    who,
};
use palpate_proto::{
    DESCRIPTOR_SET, MAX_SNAPSHOT_BYTES,
    v1::{device_server::DeviceServer, session_server::SessionServer, surface_server::SurfaceServer},
};
use std::sync::Arc;
use thiserror::Error;
use tonic::{Status, service::Routes};
use tonic_health::server::HealthReporter;
use tonic_web::GrpcWebLayer;
use tower::Layer;

/// The built-in descriptor set does not decode; a fault of the build.
#[derive(Debug, Error)]
#[error("the built-in descriptor set cannot be served by reflection: {0}")]
pub struct ReflectionError(#[from] tonic_reflection::server::Error);

/// Every service behind the gate, each with gRPC-web, and the page as the fallback.
///
/// The gRPC-web layer is put around each service and not around the router: it would refuse the page's plain GETs.
///
/// # Errors
/// [`ReflectionError`].
pub async fn routes(
    daemon: &Arc<Daemon>,
    gate: Gate,
    guard: Guard,
    known: who::gate::Gate,
) -> Result<(Routers, HealthReporter), ReflectionError> {
    let web = GrpcWebLayer::new();
    let device = DeviceServer::new(device::DeviceService { daemon: Arc::clone(daemon) })
        .max_decoding_message_size(MAX_SMALL_BYTES);
    let surface = SurfaceServer::new(surface::SurfaceService { daemon: Arc::clone(daemon), said: Arc::default() })
        .max_decoding_message_size(MAX_SMALL_BYTES);
    let session = SessionServer::new(session::SessionService { daemon: Arc::clone(daemon), said: Arc::default() })
        .max_decoding_message_size(MAX_SNAPSHOT_BYTES)
        .max_encoding_message_size(MAX_SNAPSHOT_BYTES);
    let (health, health_service) = tonic_health::server::health_reporter();
    health.set_serving::<DeviceServer<device::DeviceService>>().await;
    health.set_serving::<SurfaceServer<surface::SurfaceService>>().await;
    health.set_serving::<SessionServer<session::SessionService>>().await;
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(DESCRIPTOR_SET)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let daemon = Arc::clone(daemon);
    let of_daemon = move || async move { metrics::serve(&daemon) };
    let arms = Routes::new(device.clone())
        .into_axum_router()
        .layer(axum::middleware::from_fn_with_state(known.clone(), who::gate::pass));
    let all = Routes::new(web.layer(device))
        .add_service(web.layer(surface))
        .add_service(web.layer(session))
        .add_service(web.layer(health_service))
        .add_service(reflection().build_v1()?.max_decoding_message_size(MAX_SMALL_BYTES))
        .add_service(reflection().build_v1alpha()?.max_decoding_message_size(MAX_SMALL_BYTES))
        .into_axum_router()
        .route(metrics::PATH, axum::routing::get(of_daemon))
        .fallback(page_or_unimplemented)
        .layer(axum::middleware::from_fn_with_state(gate, whole::take))
        // Nothing of a request is read before it is known who sends it.
        .layer(axum::middleware::from_fn_with_state(known, who::gate::pass))
        // Asked first: layers are put around what is there.
        .layer(axum::middleware::from_fn_with_state(guard, origin::check));
    Ok((Routers { all, arms }, health))
}

/// A gRPC call of an unknown service gets gRPC's answer, everything else the page.
async fn page_or_unimplemented(request: axum::extract::Request) -> axum::response::Response {
    if whole::is_grpc(request.headers()) {
        let text = format!("there is no service at {}; reflection lists them", request.uri().path());
        let (parts, ()) = Status::unimplemented(text).into_http::<()>().into_parts();
        return axum::response::Response::from_parts(parts, axum::body::Body::empty());
    }
    page::serve(request.method(), request.uri())
}

/// The session a request means: the current one, by its id or by an empty one.
///
/// # Errors
/// `NOT_FOUND`.
pub fn current_session(daemon: &Daemon, id: &str) -> Result<Arc<ActiveSession>, Status> {
    let session = daemon.session();
    if id.is_empty() || id == session.id {
        return Ok(session);
    }
    let current = &session.id;
    let shown: String = id.chars().take(64).flat_map(char::escape_debug).collect();
    Err(Status::not_found(format!(
        "there is no session \"{shown}\"; the current one is \"{current}\" (or leave it empty)"
    )))
}
