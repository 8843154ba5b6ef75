//! A robot that uses the map: it keeps a replica, finds out where it is, and drives where it is told.
//!
//! | module | idea |
//! | --- | --- |
//! | [`replica`] | a live copy of the map over Zenoh |
//! | [`sync`] | what is taken in and asked for, and which release is run |
//! | [`closures`] | what is closed now |
//! | [`follow`] | when the copy has to ask, and when it cannot be trusted any more |
//! | [`ask`] | questions to the server |
//! | [`inquiry`] | questions put beside the robot's loop |
//! | [`landmarks`] | the replica's main nodes: what they look like, and what they saw |
//! | [`preparation`] | putting it together beside the robot's loop |
//! | [`odometry`] | wheel odometry corrected by scans |
//! | [`estimate`] | one estimation of the place |
//! | [`consensus`] | which estimations agree |
//! | [`hypotheses`] | where the robot may be, weighed by all that it saw |
//! | [`settle`] | the pose of a fix: the optimum over the estimations that agree |
//! | [`relocalize`] | finding the place without a guess (paper, section III-C-1) |
//! | [`tracking`] | keeping it while driving |
//! | [`localize`] | odometry, relocalization and tracking put together |
//! | [`local_map`] | the robot's own live grid |
//! | [`wander`] | where to go while the place is not known |
//! | [`route`] | following a path of the map (section III-C-2) |
//! | [`blockages`] | ways found blocked, for a while |
//! | [`steering`] | driving to a point on the live grid |
//! | [`pilot`] | all of it: the paper's Algorithm 2 |
//! | [`free_space`] | where it may drive, made of the replica beside the robot's loop |
//! | [`paths`] | paths from the server, or from the replica |
//! | [`mission`] | a task in a simulated world, scored |
//! | [`report`] | what happened, as figures |
//! | [`recording`] | the run as a bag |
//! | [`cli`] | the command line |

pub mod ask;
pub mod blockages;
pub mod cli;
pub mod closures;
pub mod consensus;
pub mod estimate;
pub mod follow;
pub mod free_space;
pub mod hypotheses;
pub mod inquiry;
pub mod landmarks;
pub mod local_map;
pub mod localize;
pub mod mission;
pub mod odometry;
pub mod paths;
pub mod pilot;
pub mod preparation;
pub mod recording;
pub mod relocalize;
pub mod replica;
pub mod report;
pub mod route;
pub mod settle;
pub mod steering;
pub mod sync;
pub mod tracking;
pub mod wander;
