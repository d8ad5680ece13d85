//! Orders to the loop. The caller allocates everything an order needs; the loop works on it and sends it back whole, so that it
//! neither allocates nor frees. A clerk task outside the loop answers the callers.
use super::{
    bell::{Ear, bell},
    inject::{self, InjectRefusal, Injection},
    simulation::Simulation,
};
use glam::DVec3;
use palpate_physics::{Model, PointForce, State};
use palpate_realtime::Doorbell;
use rtrb::{Consumer, Producer, RingBuffer};
use std::{io, sync::Arc, time::Duration};
use thiserror::Error;
use tokio::{
    sync::{Mutex, Semaphore, oneshot},
    time::timeout,
};

/// Orders that may wait or be worked on at a time.
pub const CAPACITY: usize = 64;
/// Orders to pause or to go on that are waiting or worked on.
pub(super) const PAUSES: usize = 16;
/// An answer that takes longer means the loop is not running.
const PATIENCE: Duration = Duration::from_secs(5);

/// What the loop shall do.
#[derive(Debug)]
pub enum Request {
    /// Take another session; comes back with the old one. This, [`Request::Reset`] and [`Request::Restore`] wait until the
    /// force of every device has ramped to zero.
    Load(Box<Simulation>),
    /// Back to rest at tick 0.
    Reset,
    /// Stop time, or let it go on.
    Pause(bool),
    /// Advance paused time by so many ticks.
    Step(u32),
    /// Fill the copy.
    Copy(Box<Copy>),
    /// Take this state of the same model.
    Restore(Box<State>),
    /// Take these forces, all or none.
    Inject(Vec<Injection>),
}

/// What the loop shows of itself.
#[derive(Debug)]
pub struct Copy {
    /// The state.
    pub state: State,
    /// Force (N) that holds each prescribed degree of freedom; as long as the model has nodes.
    pub reactions_n: Vec<DVec3>,
    /// Forces that were injected into the last tick.
    pub injected: Vec<PointForce>,
}

impl Copy {
    /// Room for a model's.
    pub fn of(model: &Model) -> Self {
        Self {
            state: State::at_rest(model),
            reactions_n: vec![DVec3::ZERO; model.rest_positions_m().len()],
            injected: Vec::with_capacity(inject::CAPACITY),
        }
    }
}

/// How time stands after an order.
#[derive(Debug, Clone, std::marker::Copy, PartialEq, Default)]
pub struct Done {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time (s).
    pub time_s: f64,
    /// Whether time stands.
    pub paused: bool,
    /// After [`Request::Inject`]: first tick one of them acts in.
    pub first_tick: u64,
    /// Injected forces waiting or acting.
    pub pending: u32,
}

/// Why the loop did not do it. Nothing was changed.
#[derive(Debug, Clone, std::marker::Copy, PartialEq, Eq, Error)]
pub enum Refusal {
    /// Another scene was loaded meanwhile.
    #[error("another scene was loaded meanwhile")]
    OtherSession,
    /// Steps need a paused session.
    #[error("the session is running: pause it before stepping")]
    NotPaused,
    /// One step order at a time.
    #[error("an earlier step order is still being worked on")]
    Stepping,
    /// Reset, restored, resumed or replaced before all ticks were done.
    #[error("interrupted before all ticks were done")]
    Interrupted,
    /// The state's shape is another one.
    #[error("the state belongs to another body")]
    OtherBody,
    /// Injections.
    #[error("injection refused")]
    Inject(InjectRefusal),
    /// The daemon is stopping.
    #[error("the daemon is shutting down")]
    Stopping,
    /// Too many orders are waiting.
    #[error("too many orders are waiting: try again later")]
    Busy,
    /// No answer.
    #[error("the simulation loop does not answer")]
    Silent,
}

/// An order on its way.
#[derive(Debug)]
pub struct Command {
    /// Session it is meant for.
    pub session: u64,
    /// What to do.
    pub request: Request,
    reply: oneshot::Sender<Answer>,
}

/// An order that came back.
#[derive(Debug)]
pub struct Answer {
    /// The order.
    pub request: Request,
    /// What became of it.
    pub outcome: Result<Done, Refusal>,
}

/// A finished order on its way to the clerk.
#[derive(Debug)]
pub struct Finished {
    command: Command,
    outcome: Result<Done, Refusal>,
}

/// The loop's end.
#[derive(Debug)]
pub struct Desk {
    pauses: Consumer<Command>,
    orders: Consumer<Command>,
    finished: Producer<Finished>,
    // After `finished`: when the loop is gone, its last ring comes when the queue is seen to be abandoned.
    bell: RingAtEnd,
}

#[derive(Debug)]
struct RingAtEnd(Doorbell);

impl Drop for RingAtEnd {
    fn drop(&mut self) {
        self.0.ring();
    }
}

/// The callers' end.
#[derive(Debug, Clone)]
pub struct Orders {
    pauses: Queue,
    others: Queue,
}

/// A way to the loop.
#[derive(Debug, Clone)]
struct Queue {
    producer: Arc<Mutex<Producer<Command>>>,
    /// One permit per order that is queued or worked on: neither this queue nor that of finished ones can overflow.
    room: Arc<Semaphore>,
}

impl Queue {
    fn of(places: usize) -> (Self, Consumer<Command>) {
        let (producer, consumer) = RingBuffer::new(places);
        (Self { producer: Arc::new(Mutex::new(producer)), room: Arc::new(Semaphore::new(places)) }, consumer)
    }
}

/// The clerk's end.
#[derive(Debug)]
pub struct Clerk {
    finished: Consumer<Finished>,
    ear: Ear,
}

/// All three ends.
///
/// # Errors
/// See [`bell`].
pub fn desk() -> io::Result<(Desk, Orders, Clerk)> {
    let (bell, ear) = bell()?;
    let (others_in, orders) = Queue::of(CAPACITY);
    let (pauses_in, pauses) = Queue::of(PAUSES);
    let (finished_in, finished) = RingBuffer::new(CAPACITY + PAUSES);
    let orders_end = Orders { pauses: pauses_in, others: others_in };
    Ok((Desk { pauses, orders, finished: finished_in, bell: RingAtEnd(bell) }, orders_end, Clerk { finished, ear }))
}

impl Desk {
    /// The next order to pause or to go on. These go before all others: whoever wants time to stop does not stand in a queue.
    pub fn next_pause(&mut self) -> Option<Command> {
        self.pauses.pop().ok()
    }

    /// The next of the other orders.
    pub fn next_order(&mut self) -> Option<Command> {
        self.orders.pop().ok()
    }

    /// Sends an order back.
    pub fn finish(&mut self, command: Command, outcome: Result<Done, Refusal>) {
        if let Err(rtrb::PushError::Full(unsent)) = self.finished.push(Finished { command, outcome }) {
            // Cannot happen: there are no more orders than places. Leaking is the only thing that costs the loop nothing.
            std::mem::forget(unsent);
        }
        self.bell.0.ring();
    }
}

impl Clerk {
    /// Answers callers until the loop is gone.
    pub async fn work(mut self) {
        loop {
            let gone = self.finished.is_abandoned();
            while let Ok(Finished { command, outcome }) = self.finished.pop() {
                // A caller that went away does not need its answer.
                let _ = command.reply.send(Answer { request: command.request, outcome });
            }
            if gone || self.ear.rung().await.is_err() {
                return;
            }
        }
    }
}

impl Orders {
    /// Gives an order to a session and waits for it to come back. Orders that take long (`patient`) are waited for without limit. An
    /// order to pause has a queue of its own, and is not refused because others wait.
    ///
    /// # Errors
    /// [`Refusal`].
    pub async fn give(&self, session: u64, request: Request, patient: bool) -> Result<(Request, Done), Refusal> {
        let is_pause = matches!(request, Request::Pause(_));
        let Queue { producer, room } = if is_pause { &self.pauses } else { &self.others };
        let permit = if is_pause {
            let room = timeout(PATIENCE, Arc::clone(room).acquire_owned()).await;
            room.map_err(|_| Refusal::Silent)?.map_err(|_| Refusal::Stopping)?
        } else {
            Arc::clone(room).try_acquire_owned().map_err(|_| Refusal::Busy)?
        };
        let (reply, answer) = oneshot::channel();
        {
            let mut queue = producer.lock().await;
            if queue.is_abandoned() {
                return Err(Refusal::Stopping);
            }
            queue.push(Command { session, request, reply }).map_err(|_| Refusal::Busy)?;
        }
        // The permit lives until the order is back, even when the caller goes away before.
        let waiting = tokio::spawn(async move {
            let answer = answer.await;
            drop(permit);
            answer
        });
        let answer =
            if patient { waiting.await } else { timeout(PATIENCE, waiting).await.map_err(|_| Refusal::Silent)? };
        let answer = answer.map_err(|_| Refusal::Stopping)?.map_err(|_| Refusal::Stopping)?;
        answer.outcome.map(|done| (answer.request, done))
    }
}
