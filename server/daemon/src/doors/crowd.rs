//! Who is connected. When all places are taken, one more takes the place of whoever has been idle for longest: connections that
//! ask for nothing never keep anybody out.
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// All that are connected.
#[derive(Debug)]
pub struct Crowd {
    most: usize,
    /// Orders idle connections by when they became so.
    next: AtomicU64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    places: usize,
    /// Idle connections: the first has been so for longest.
    idle: BTreeMap<u64, CancellationToken>,
}

impl Crowd {
    /// Nobody, and places for so many.
    pub fn of(most: usize) -> Arc<Self> {
        Arc::new(Self { most, next: AtomicU64::new(0), state: Mutex::default() })
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Connections now.
    pub fn count(&self) -> usize {
        self.lock().places
    }

    /// A place, and whether an idle connection has to leave for it; `None` when all are taken by such as are in use.
    pub fn enter(self: &Arc<Self>) -> Option<(Place, bool)> {
        let (gone, number) = (CancellationToken::new(), self.next.fetch_add(1, Ordering::Relaxed));
        let is_full = {
            let mut state = self.lock();
            let is_full = state.places >= self.most;
            if is_full && !state.evict() {
                return None;
            }
            state.places += 1;
            state.idle.insert(number, gone.clone());
            is_full
        };
        let streams = Streams { in_flight: 0, has_asked: false, idle: Some(number), since: Instant::now() };
        Some((Place { crowd: Arc::clone(self), gone, streams: Mutex::new(streams) }, is_full))
    }

    /// Sends the connection away that has been idle for longest; whether there was one. Its place is free at once.
    pub fn evict(&self) -> bool {
        self.lock().evict()
    }
}

impl State {
    fn evict(&mut self) -> bool {
        let Some((_, gone)) = self.idle.pop_first() else { return false };
        gone.cancel();
        self.places -= 1;
        true
    }
}

/// The place of one connection.
#[derive(Debug)]
pub struct Place {
    crowd: Arc<Crowd>,
    gone: CancellationToken,
    streams: Mutex<Streams>,
}

#[derive(Debug)]
struct Streams {
    in_flight: usize,
    has_asked: bool,
    /// Its number among idle connections.
    idle: Option<u64>,
    /// Since when it is idle, or was last.
    since: Instant,
}

impl Place {
    fn lock(&self) -> MutexGuard<'_, Streams> {
        self.streams.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Cancelled when another takes the place.
    pub fn gone(&self) -> &CancellationToken {
        &self.gone
    }

    /// A request begins.
    pub fn begin(&self) {
        let mut streams = self.lock();
        streams.in_flight += 1;
        streams.has_asked = true;
        if let Some(number) = streams.idle.take() {
            self.crowd.lock().idle.remove(&number);
        }
    }

    /// A request, with its answer, has ended.
    pub fn end(&self) {
        let mut streams = self.lock();
        streams.in_flight -= 1;
        if streams.in_flight == 0 {
            self.becomes_idle(&mut streams);
        }
    }

    fn becomes_idle(&self, streams: &mut Streams) {
        let number = self.crowd.next.fetch_add(1, Ordering::Relaxed);
        streams.idle = Some(number);
        streams.since = Instant::now();
        let mut state = self.crowd.lock();
        // One that has been sent away while a request began has no place to give up a second time.
        if !self.gone.is_cancelled() {
            state.idle.insert(number, self.gone.clone());
        }
    }

    /// Whether there ever was a request.
    pub fn has_asked(&self) -> bool {
        self.lock().has_asked
    }

    /// Since when nothing is asked for; `None` while something is.
    pub fn idle_since(&self) -> Option<Instant> {
        let streams = self.lock();
        (streams.in_flight == 0).then_some(streams.since)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if let Some(number) = self.lock().idle.take() {
            self.crowd.lock().idle.remove(&number);
        }
        // An evicted one's place was given away when it was.
        if !self.gone.is_cancelled() {
            self.crowd.lock().places -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_longest_idle_leaves_and_whoever_is_in_use_stays() {
        let crowd = Crowd::of(3);
        let enter = || crowd.enter().map(|(place, evicts)| (Arc::new(place), evicts));
        let (first, _) = enter().unwrap();
        let (second, _) = enter().unwrap();
        let (third, evicts) = enter().unwrap();
        assert!(!evicts && crowd.count() == 3);
        first.begin();
        second.begin();
        second.end();
        // The second is idle for a shorter time than the third.
        let (fourth, evicts) = enter().unwrap();
        assert!(evicts && third.gone().is_cancelled() && !second.gone().is_cancelled());
        assert_eq!(crowd.count(), 3);
        drop(third);
        assert_eq!(crowd.count(), 3, "its place was counted as free already");
        second.begin();
        fourth.begin();
        assert!(enter().is_none(), "all are in use");
        fourth.end();
        let (_fifth, evicts) = enter().unwrap();
        assert!(evicts && fourth.gone().is_cancelled());
        drop((first, second));
        assert_eq!(crowd.count(), 1);
    }

    #[tokio::test]
    async fn a_place_tells_since_when_it_is_idle() {
        let (place, _) = Crowd::of(1).enter().unwrap();
        let from = place.idle_since().unwrap();
        place.begin();
        place.begin();
        place.end();
        assert_eq!(place.idle_since(), None);
        place.end();
        assert!(place.idle_since().unwrap() >= from);
    }
}
