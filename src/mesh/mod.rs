//! Plain mesh data and the kernel that edits it. Knows nothing of files, recipes or steps.

pub mod bvh;
pub mod carried;
pub mod classes;
pub mod contact;
pub mod edit;
pub mod freedom;
pub mod geometry;
pub mod halfedge;
pub mod hierarchy;
pub mod id;
pub mod meetings;
pub mod patches;
pub mod predicate;
pub mod quads;
pub mod soup;
pub mod surface;
pub mod topology;
pub mod transfer;
pub mod validate;

pub use carried::{
    Carried, Curve, EdgeKey, EdgeMark, Field, Freedom, Groups, MarkCause, Regions, SeamId, Support, SurfacePoint,
    edge_key,
};
pub use freedom::{FreedomError, LockRules, ResolvedFreedom, Rim, resolve_freedom};
pub use halfedge::HalfedgeMesh;
pub use hierarchy::Hierarchy;
pub use id::{EdgeId, FaceId, HalfedgeId, Id, IdVec, VertexId};
pub use patches::{Patch, Patches, Seam};
pub use quads::{Cover, Quads};
pub use soup::{Facet, Soup};
pub use surface::Surface;
