//! The web page, built into the program, and the descriptor set it reads the wire types from.
use axum::{
    body::Body,
    http::{Method, Response, StatusCode, Uri, header},
};
use rust_embed::RustEmbed;

/// The page's built bundle.
#[derive(RustEmbed)]
#[folder = "../../client-viewer/web/dist"]
struct Bundle;

/// Where the page finds the encoded `FileDescriptorSet` of `palpate.v1`.
pub const DESCRIPTOR_PATH: &str = "palpate.v1.binpb";

/// The page loads and asks for nothing but what is the daemon's, and is shown in no other page.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Answers everything that is no gRPC call.
pub fn serve(method: &Method, uri: &Uri) -> Response<Body> {
    if *method != Method::GET && *method != Method::HEAD {
        return text(StatusCode::METHOD_NOT_ALLOWED, "the page is read with GET; gRPC calls need a known service\n");
    }
    let path = uri.path().trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    if path == DESCRIPTOR_PATH {
        return found("application/octet-stream", Body::from(palpate_proto::DESCRIPTOR_SET));
    }
    match Bundle::get(path) {
        Some(file) => found(mime_of(path), Body::from(file.data.into_owned())),
        None => text(StatusCode::NOT_FOUND, "there is no such page; the viewer is at /\n"),
    }
}

fn found(mime: &'static str, body: Body) -> Response<Body> {
    let mut response = Response::new(body);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, header::HeaderValue::from_static(mime));
    // Names carry no hash: a browser asks again, so that page and daemon are of one version.
    headers.insert(header::CACHE_CONTROL, header::HeaderValue::from_static("no-cache"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, header::HeaderValue::from_static("nosniff"));
    headers.insert(header::CONTENT_SECURITY_POLICY, header::HeaderValue::from_static(POLICY));
    response
}

fn text(status: StatusCode, message: &'static str) -> Response<Body> {
    let mut response = found("text/plain; charset=utf-8", Body::from(message));
    *response.status_mut() = status;
    response
}

fn mime_of(path: &str) -> &'static str {
    match path.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("json" | "map") => "application/json",
        Some("woff2") => "font/woff2",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn get(path: &str) -> (StatusCode, String) {
        let response = serve(&Method::GET, &path.parse().unwrap());
        let mime = response.headers()[header::CONTENT_TYPE].to_str().unwrap().to_owned();
        (response.status(), mime)
    }

    #[test]
    fn the_page_and_its_descriptor_set_are_there_and_nothing_else_is() {
        assert_eq!(get("/"), (StatusCode::OK, "text/html; charset=utf-8".into()));
        assert_eq!(get("/palpate.v1.binpb"), (StatusCode::OK, "application/octet-stream".into()));
        assert_eq!(get("/../Cargo.toml").0, StatusCode::NOT_FOUND);
        assert_eq!(serve(&Method::POST, &"/".parse().unwrap()).status(), StatusCode::METHOD_NOT_ALLOWED);
    }

    #[test]
    fn everything_the_index_refers_to_is_built_in() {
        let index = Bundle::get("index.html").unwrap();
        let text = String::from_utf8(index.data.into_owned()).unwrap();
        for part in text.split('"').filter(|part| part.starts_with("./")) {
            assert!(Bundle::get(part.trim_start_matches("./")).is_some(), "{part}");
        }
    }
}
