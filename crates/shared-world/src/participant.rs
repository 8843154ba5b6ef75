//! A robot's place in a shared world, and whoever keeps the world while no robot is there.

use crate::folder::{Alive, Locked, Stored, WorldFileError, WorldFolder};
use fht_perception::frame::Twist;
use fht_perception::robot::RobotError;
use fht_proto::SharedWorldName;
use fht_sim::{Commons, CommonsError, Entrant, Going, SharedWorld, SimSetup, Simulator, Turn};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A robot that lives and says nothing for so long is not waited for.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// How long somebody else may have the world's file, or stand where this robot starts.
const LONGEST: Duration = Duration::from_secs(30);
/// Whoever leaves waits no longer for the world's file.
const LEAVING: Duration = Duration::from_secs(2);
/// A closed world that is there for longer was left by somebody who died.
const CLOSING: Duration = Duration::from_millis(500);
/// Between two looks.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// Why a robot cannot be in a shared world.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// Its files cannot be used.
    #[error("the shared world {name} cannot be used: {source}")]
    Files {
        /// The world.
        name: SharedWorldName,
        /// Why.
        source: WorldFileError,
    },
    /// Somebody else has its file and does not give it back.
    #[error("the shared world {name} is held by a program that has not answered for {} s", LONGEST.as_secs())]
    Held {
        /// The world.
        name: SharedWorldName,
    },
    /// There is one of this name.
    #[error("a robot called {robot} is in the shared world {name} already; give this one another --robot")]
    NameTaken {
        /// The world.
        name: SharedWorldName,
        /// The robot.
        robot: String,
    },
    /// It is another world.
    #[error("this robot cannot be in the shared world {name}: {source}")]
    Other {
        /// The world.
        name: SharedWorldName,
        /// Why.
        source: CommonsError,
    },
    /// The robot is not there any more.
    #[error("the robot is no longer in the shared world {name}: somebody has removed its files")]
    Gone {
        /// The world.
        name: SharedWorldName,
    },
}

impl JoinError {
    /// Whether what was given is wrong, and not the run.
    #[must_use]
    pub fn is_input(&self) -> bool {
        matches!(self, Self::NameTaken { .. } | Self::Other { .. })
    }
}

/// A place in a world, until it is given back.
struct Seat {
    name: SharedWorldName,
    folder: WorldFolder,
    /// The robot's name; none: a keeper.
    robot: Option<String>,
    alive: Mutex<Option<Alive>>,
}

impl Seat {
    /// Takes a place; `begin` looks at the world, and says what it is from then on.
    fn take(
        name: &SharedWorldName,
        file: &str,
        robot: Option<&str>,
        mut begin: impl FnMut(&Locked<'_>, Stored) -> Result<(), JoinError>,
    ) -> Result<Self, JoinError> {
        let asked = Instant::now();
        while asked.elapsed() < LONGEST {
            let opened = WorldFolder::open(name);
            let folder = opened.map_err(|source| JoinError::Files { name: name.clone(), source })?;
            let is_still_there = asked.elapsed() > CLOSING;
            if let Some(alive) = Self::try_take(&folder, name, (file, robot), is_still_there, &mut begin)? {
                let (name, robot) = (name.clone(), robot.map(str::to_owned));
                return Ok(Self { name, folder, robot, alive: Mutex::new(Some(alive)) });
            }
            std::thread::sleep(LOOK_AGAIN);
        }
        Err(JoinError::Held { name: name.clone() })
    }

    /// The place, if nobody else has the world's file just now and the folder is not about to go.
    fn try_take(
        folder: &WorldFolder,
        name: &SharedWorldName,
        (file, robot): (&str, Option<&str>),
        is_still_there: bool,
        begin: &mut impl FnMut(&Locked<'_>, Stored) -> Result<(), JoinError>,
    ) -> Result<Option<Alive>, JoinError> {
        let files = |source| JoinError::Files { name: name.clone(), source };
        let Some(locked) = folder.lock().map_err(files)? else { return Ok(None) };
        let stored = match locked.has_anybody() {
            true => locked.read().map_err(files)?,
            // What those have left who are all dead is nobody's.
            false => nobodys(&locked, is_still_there),
        };
        if stored == Stored::Closed {
            return Ok(None);
        }
        let taken = || JoinError::NameTaken { name: name.clone(), robot: robot.unwrap_or(file).to_owned() };
        let alive = locked.take_seat(file).map_err(files)?.ok_or_else(taken)?;
        match begin(&locked, stored) {
            Ok(()) => Ok(Some(alive)),
            Err(error) => {
                locked.give_back(alive);
                Err(error)
            }
        }
    }

    fn files(&self, source: WorldFileError) -> JoinError {
        JoinError::Files { name: self.name.clone(), source }
    }

    /// Gives the place back, once: the robot is gone.
    fn give_back(&self) {
        let Some(alive) = self.alive.lock().unwrap_or_else(PoisonError::into_inner).take() else { return };
        let asked = Instant::now();
        while asked.elapsed() < LEAVING {
            match self.folder.lock() {
                Ok(Some(locked)) => {
                    if let (Some(robot), Ok(Stored::State(mut state))) = (&self.robot, locked.read()) {
                        state.forget(robot);
                        if let Err(error) = locked.write(&state) {
                            tracing::warn!(%error, "the shared world is not told that the robot has gone");
                        }
                    }
                    locked.give_back(alive);
                    return;
                }
                Ok(None) => std::thread::sleep(LOOK_AGAIN),
                Err(_) => break,
            }
        }
        // Others see that nobody holds its lock.
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.give_back();
    }
}

/// What is left in a folder where nobody lives: a world that was closed before this file was locked
/// and whose folder is gone, or nothing that counts.
fn nobodys(locked: &Locked<'_>, is_still_there: bool) -> Stored {
    match locked.read() {
        Ok(Stored::Closed) if !is_still_there => Stored::Closed,
        _ => Stored::Nothing,
    }
}

/// The robot of `simulator` in its world: alone or among people of its own, or in the world that
/// `setup` says it shares, where its name is `robot`. What comes with it leaves the shared world
/// earlier than the simulator ends.
///
/// # Errors
/// [`JoinError`].
pub fn seat(simulator: Simulator, setup: &SimSetup, robot: &str) -> Result<(Simulator, WorldExit), JoinError> {
    let Some(name) = &setup.shared_world else {
        return Ok((simulator.among(setup.crowd()), WorldExit(None)));
    };
    let member = Participant::join(name, robot, &simulator, setup)?;
    let exit = WorldExit(Some(Arc::clone(&member.seat)));
    Ok((simulator.sharing(Box::new(member)), exit))
}

/// The way out of a shared world, for whoever does not hold the robot.
#[derive(Clone)]
pub struct WorldExit(Option<Arc<Seat>>);

impl WorldExit {
    /// The robot is gone, and nobody waits for it. Out of a world of its own there is no way.
    pub fn leave(&self) {
        if let Some(seat) = &self.0 {
            seat.give_back();
        }
    }
}

/// Keeps a world, and the people in it, while no robot is there. Dropped, the world goes unless
/// somebody is there.
pub struct Keeper(Seat);

impl Keeper {
    /// Keeps the world of this name.
    ///
    /// # Errors
    /// [`JoinError`].
    pub fn of(name: &SharedWorldName) -> Result<Self, JoinError> {
        static KEEPERS: AtomicU32 = AtomicU32::new(0);
        let file = format!("keeper-{}-{}", std::process::id(), KEEPERS.fetch_add(1, Ordering::Relaxed));
        Seat::take(name, &file, None, |_, _| Ok(())).map(Self)
    }

    /// The world that is kept.
    #[must_use]
    pub fn name(&self) -> &SharedWorldName {
        &self.0.name
    }
}

/// A robot's place in a shared world.
pub struct Participant {
    seat: Arc<Seat>,
    robot: String,
    entrant: Entrant,
    commons: Commons,
    /// Commands carried out of which this robot knows.
    done: u64,
    /// What it has told to do next.
    told: Option<Twist>,
    /// Since when it waits, and since when others have had the file.
    waits: Option<Instant>,
    barred: Option<Instant>,
}

impl Participant {
    /// Takes a place in the world called `name` for the robot of `simulator`. It appears when it
    /// enters.
    fn join(name: &SharedWorldName, robot: &str, simulator: &Simulator, setup: &SimSetup) -> Result<Self, JoinError> {
        let config = simulator.config();
        let entrant = Entrant { start: simulator.truth(), radius_m: config.radius_m, height_m: config.height_m() };
        let mut commons = Commons::new(Arc::clone(simulator.world()), setup.crowd(), config.lidar_period_us);
        let seat = Seat::take(name, &file_of(robot), Some(robot), |locked, stored| {
            if let Stored::State(state) = stored {
                commons.restore(&state).map_err(|source| JoinError::Other { name: name.clone(), source })?;
                // One of this name has died.
                commons.leave(robot);
            }
            let written = locked.write(&commons.state());
            written.map_err(|source| JoinError::Files { name: name.clone(), source })
        })?;
        let (seat, robot) = (Arc::new(seat), robot.to_owned());
        Ok(Self { seat, robot, entrant, commons, done: 0, told: None, waits: None, barred: None })
    }

    /// Looks at the world, once it is this robot's turn to: what `act` returns, if it is not to
    /// look again. `act` says as well whether it has changed the world.
    async fn until(
        &mut self,
        mut act: impl FnMut(&mut Self, &Locked<'_>) -> Result<(bool, Option<Turn>), JoinError> + Send,
    ) -> Result<Turn, JoinError> {
        let seat = Arc::clone(&self.seat);
        loop {
            if let Some(locked) = seat.folder.lock().map_err(|error| seat.files(error))? {
                self.barred = None;
                let gone = || JoinError::Gone { name: seat.name.clone() };
                let Stored::State(state) = locked.read().map_err(|error| seat.files(error))? else {
                    return Err(gone());
                };
                self.commons.restore(&state).map_err(|_| gone())?;
                let (has_changed, outcome) = act(self, &locked)?;
                if has_changed {
                    locked.write(&self.commons.state()).map_err(|error| seat.files(error))?;
                }
                if let Some(outcome) = outcome {
                    return Ok(outcome);
                }
            } else if self.barred.get_or_insert_with(Instant::now).elapsed() > LONGEST {
                return Err(JoinError::Held { name: seat.name.clone() });
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    }

    fn turn(&self) -> Result<Turn, JoinError> {
        self.commons.turn(&self.robot).ok_or_else(|| JoinError::Gone { name: self.seat.name.clone() })
    }

    /// Robots whose programs have died are gone. True if there were any.
    fn bury(&mut self, locked: &Locked<'_>) -> bool {
        let others = self.commons.robots().filter(|other| *other != self.robot);
        let dead: Vec<String> = others.filter(|other| !locked.is_alive(&file_of(other))).map(str::to_owned).collect();
        for robot in &dead {
            tracing::info!(robot, "its program has died: the robot is gone from the shared world");
            self.commons.leave(robot);
        }
        !dead.is_empty()
    }

    async fn appear(&mut self) -> Result<Turn, JoinError> {
        let asked = Instant::now();
        let appear = |member: &mut Self, locked: &Locked<'_>| {
            let buried = member.bury(locked);
            match member.commons.enter(&member.robot, &member.entrant) {
                Ok(()) => Ok((true, Some(member.turn()?))),
                Err(CommonsError::Occupied(_)) if asked.elapsed() < LONGEST => Ok((buried, None)),
                Err(source) => Err(JoinError::Other { name: member.seat.name.clone(), source }),
            }
        };
        let turn = self.until(appear).await?;
        self.done = turn.done;
        Ok(turn)
    }

    async fn drive(&mut self, command: Twist) -> Result<Turn, JoinError> {
        self.waits.get_or_insert_with(Instant::now);
        let go_on = move |member: &mut Self, locked: &Locked<'_>| member.look(command, locked);
        let turn = self.until(go_on).await?;
        (self.done, self.told, self.waits) = (turn.done, None, None);
        Ok(turn)
    }

    /// One look at the world of a robot that wants to do `command` next.
    fn look(&mut self, command: Twist, locked: &Locked<'_>) -> Result<(bool, Option<Turn>), JoinError> {
        let turn = self.turn()?;
        if turn.done > self.done {
            return Ok((false, Some(turn)));
        }
        let mut has_changed = self.told != Some(command);
        if has_changed {
            self.commons.command(&self.robot, command);
            self.told = Some(command);
        }
        if self.commons.missing().next().is_some() {
            has_changed |= self.bury(locked);
        }
        if self.waits.is_some_and(|since| since.elapsed() > PATIENCE) {
            let silent: Vec<String> = self.commons.missing().map(str::to_owned).collect();
            for robot in &silent {
                tracing::warn!(robot, "it has said nothing for {} s: it stands", PATIENCE.as_secs());
                self.commons.pass_over(robot);
            }
            has_changed |= !silent.is_empty();
        }
        if self.commons.missing().next().is_some() {
            return Ok((has_changed, None));
        }
        self.commons.advance();
        Ok((true, Some(self.turn()?)))
    }
}

fn file_of(robot: &str) -> String {
    format!("robot-{robot}")
}

impl SharedWorld for Participant {
    fn enter(&mut self) -> Going<'_> {
        Box::pin(async { self.appear().await.map_err(RobotError::driver) })
    }

    fn go_on(&mut self, command: Twist) -> Going<'_> {
        Box::pin(async move { self.drive(command).await.map_err(RobotError::driver) })
    }
}
