//! meshmill: recipes that turn any triangle mesh into a finite-element surface mesh, run as a cached graph.
//!
//! # What is for users of the library
//!
//! | to | use |
//! |---|---|
//! | read and write meshes | [`format::read`], [`format::write`], [`format::Format`] |
//! | hold and walk them | [`mesh`]: [`mesh::Soup`] as it came, [`mesh::Surface`] after repair |
//! | call one step as a function | [`steps`], such as [`steps::repair`]; what steps have in common is in [`step`] |
//! | measure | [`metric`] |
//! | judge elements by a standard | [`metric::gate::criteria`], read by [`criteria`] |
//! | run a whole recipe | [`recipe`] to [`plan`](mod@plan) to [`run`](mod@run) with a [`store`], then [`report`] |
//! | see progress, and cancel | [`watch`] |
//!
//! Steps and formats are pure functions of their arguments; only `run`, `store` and the command line touch files.
//!
//! [`technique`] is what steps are made of, for those who write steps. The command line and the generator of schemas
//! are left out of this documentation: the program and its tests use them. All three change without notice.
//!
//! ```
//! use meshmill::format::{self, Format};
//! use meshmill::watch::Watch;
//!
//! let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let (soup, counts) = format::read(Format::Obj, text, &Watch::silent())?;
//! assert_eq!((soup.points.len(), soup.faces.len()), (3, 1));
//! assert!(counts.left_out().is_empty());
//! # Ok::<(), meshmill::format::FormatError>(())
//! ```

#[doc(hidden)]
pub mod cli;
pub mod criteria;
pub mod format;
pub mod mesh;
pub mod metric;
pub mod plan;
pub mod recipe;
pub mod report;
pub mod run;
#[doc(hidden)]
pub mod schema;
pub mod step;
pub mod steps;
pub mod store;
pub mod technique;
pub(crate) mod terminal;
pub mod watch;
