//! Web pages of others: a browser lets any page send requests to this daemon, and tells where they come from. Only the daemon's own
//! page is answered, under a name that is known to be this machine's.
//!
//! - `Origin`, which browsers add to every POST and to no one else's request, must be the host that the request is for.
//! - `Host` of such a request, and of the page, must be an address or a known name. A foreign name that leads here belongs to a page
//!   which has had its own name's address changed, to be of the same origin as the daemon (DNS rebinding).
//! - A call of a service must be of gRPC's content type, which a page cannot send to another origin unasked.
//!
//! Clients that are no browsers send no `Origin`; nothing of this touches them.
use super::{
    refusals::{Peer, Reason, Refusals},
    whole::is_grpc,
};
use axum::{
    body::Body,
    extract::{Request, State},
    http::{
        HeaderMap, HeaderValue, StatusCode, Uri,
        header::{CONTENT_TYPE, HOST, ORIGIN},
        uri::Authority,
    },
    middleware::Next,
    response::Response,
};
use std::{net::IpAddr, sync::Arc};

/// Names by which browsers may know this daemon, beside its addresses.
#[derive(Debug, Clone)]
pub struct Guard {
    names: Arc<[String]>,
    refusals: Arc<Refusals>,
}

impl Guard {
    /// `localhost`, the machine's name, alone and under `.local`, and those given.
    pub fn new(given: &[String], refusals: &Arc<Refusals>) -> Self {
        let host = rustix::system::uname().nodename().to_string_lossy().to_ascii_lowercase();
        let own = ["localhost".to_owned(), format!("{host}.local"), host];
        let given = given.iter().map(|name| name.to_ascii_lowercase());
        let names = own.into_iter().chain(given).filter(|name| !name.is_empty() && name != ".local").collect();
        Self { names, refusals: Arc::clone(refusals) }
    }

    fn knows(&self, host: &str) -> bool {
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        let name = host.trim_end_matches('.').to_ascii_lowercase();
        bare.parse::<IpAddr>().is_ok() || self.names.contains(&name)
    }

    /// What is wrong with a request, in words for its sender.
    fn fault(&self, uri: &Uri, headers: &HeaderMap) -> Option<(StatusCode, String)> {
        let origin = headers.get(ORIGIN);
        let is_call = is_call(uri.path());
        if is_call && !is_grpc(headers) {
            let text = "a call of a service has the content type application/grpc, or application/grpc-web";
            return Some((StatusCode::UNSUPPORTED_MEDIA_TYPE, text.to_owned()));
        }
        if origin.is_none() && is_call {
            return None;
        }
        // HTTP/2 has it in the URI.
        let host = headers.get(HOST).and_then(|host| host.to_str().ok()?.parse().ok());
        let Some(host) = host.or_else(|| uri.authority().cloned()) else {
            return Some((StatusCode::BAD_REQUEST, "the request does not say which host it is for".to_owned()));
        };
        if !self.knows(host.host()) {
            let name: String = host.host().chars().take(255).collect();
            let text = format!("this machine is not known as {name}: start the daemon with --host {name} if it is");
            return Some((StatusCode::MISDIRECTED_REQUEST, text));
        }
        if origin.is_some_and(|origin| !is_of(origin, &host)) {
            return Some((StatusCode::FORBIDDEN, "only the daemon's own page is answered".to_owned()));
        }
        None
    }
}

/// Whether a path is of a service's method, such as `/palpate.v1.Session/Pause`; the page has files whose names begin so.
pub fn is_call(path: &str) -> bool {
    let service = path.trim_start_matches('/').split_once('/').map_or("", |(service, _)| service);
    service.starts_with("palpate.v1.") || service.starts_with("grpc.")
}

/// Whether an origin, such as `http://localhost:7411`, is this host.
fn is_of(origin: &HeaderValue, host: &Authority) -> bool {
    let origin: Option<Uri> = origin.to_str().ok().and_then(|origin| origin.parse().ok());
    let Some((scheme, authority)) = origin.as_ref().and_then(|uri| Some((uri.scheme_str()?, uri.authority()?))) else {
        return false;
    };
    let usual = match scheme {
        "http" => 80,
        "https" => 443,
        _ => return false,
    };
    let port = |of: &Authority| of.port_u16().unwrap_or(usual);
    authority.host().eq_ignore_ascii_case(host.host()) && port(authority) == port(host)
}

/// Lets a request pass, or answers what is wrong with it.
pub async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let Some((code, text)) = guard.fault(request.uri(), request.headers()) else {
        let mut response = next.run(request).await;
        // A proxy that gathers answers would keep streams from who watches: nginx asks this header.
        response.headers_mut().insert("x-accel-buffering", HeaderValue::from_static("no"));
        return response;
    };
    guard.refusals.count(Reason::Foreign, request.extensions().get::<Peer>().copied());
    let mut response = Response::new(Body::from(text + "\n"));
    *response.status_mut() = code;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    response
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderName;

    fn answer(path: &str, headers: &[(&str, &str)]) -> u16 {
        let guard = Guard::new(&["Heart.Example".into()], &Arc::default());
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.insert(HeaderName::try_from(*name).unwrap(), HeaderValue::from_str(value).unwrap());
        }
        guard.fault(&path.parse().unwrap(), &map).map_or(200, |(code, _)| code.as_u16())
    }

    const PAUSE: &str = "/palpate.v1.Session/Pause";
    const WEB: (&str, &str) = ("content-type", "application/grpc-web+proto");

    #[test]
    fn the_page_is_served_under_known_names_only() {
        let own = rustix::system::uname().nodename().to_string_lossy().into_owned();
        for host in [
            "127.0.0.1:7411",
            "[::1]:7411",
            "10.1.2.3",
            "localhost:7411",
            "LOCALHOST",
            "heart.example:80",
            own.as_str(),
        ] {
            assert_eq!(answer("/", &[("host", host)]), 200, "{host}");
        }
        for host in ["evil.example:7411", "localhost.evil.example", "127.0.0.1.evil.example", "heart.example.org"] {
            assert_eq!(answer("/", &[("host", host)]), 421, "{host}");
        }
        for file in ["/palpate.v1.binpb", "/assets/palpate.js"] {
            assert_eq!(answer(file, &[("host", "localhost")]), 200, "{file}");
        }
        assert_eq!(answer("/", &[]), 400);
        assert_eq!(answer("http://evil.example/", &[]), 421, "as HTTP/2 says it");
        assert_eq!(answer("http://localhost:7411/", &[]), 200);
    }

    #[test]
    fn only_the_own_page_may_call_from_a_browser() {
        let call = |host: &str, origin: &str| answer(PAUSE, &[WEB, ("host", host), ("origin", origin)]);
        assert_eq!(call("localhost:7411", "http://localhost:7411"), 200);
        assert_eq!(call("heart.example", "https://heart.example"), 200);
        assert_eq!(call("heart.example", "https://heart.example:443"), 200);
        for origin in [
            "http://evil.example",
            "null",
            "http://localhost:3000",
            "http://localhost",
            "https://localhost.evil.example:7411",
            "file://",
            "chrome-extension://abc",
            "",
            "http://localhost:7411@evil.example",
        ] {
            assert_eq!(call("localhost:7411", origin), 403, "{origin}");
        }
        // A page whose name has been led here.
        assert_eq!(call("evil.example:7411", "http://evil.example:7411"), 421);
    }

    #[test]
    fn a_call_is_of_grpcs_content_type() {
        for kind in ["text/plain", "application/x-www-form-urlencoded", "application/json"] {
            assert_eq!(answer(PAUSE, &[("content-type", kind), ("host", "localhost")]), 415, "{kind}");
        }
        assert_eq!(answer(PAUSE, &[("host", "localhost")]), 415);
        // No browser, by any name.
        assert_eq!(answer(PAUSE, &[("content-type", "application/grpc"), ("host", "lab.example")]), 200);
    }
}
