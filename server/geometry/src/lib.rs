//! Geometry of Plica: hexahedral and tetrahedral meshes, generated shapes of the scenes, triangle skins and their clusters, convex
//! polytopes, embedding weights, mesh files.
//!
//! Everything is `f64` in SI units (metres), right-handed, z up. This crate knows no physics, no bus and no clock.

mod box_tree;
mod clusters;
mod convex_polytope;
mod convexity;
mod display_surface;
mod embedding;
mod exponential_map;
pub mod export;
mod face;
mod hex_mesh;
pub mod import;
mod index;
pub mod isoparametric;
pub mod joints;
mod locate;
mod neighbourhood;
pub mod predicate;
mod reference_skin;
pub mod select;
pub mod shapes;
mod skin;
mod tet_mesh;
pub mod tetrahedron;
mod triangle;
mod volume_mesh;

pub use clusters::CLUSTER_SIZE;
pub use convex_polytope::{ConvexPolytope, FaceDistance, FacePlane, HullError};
pub use convexity::hull_stand_off;
pub use display_surface::{DisplaySurface, vertex_normals_into};
pub use embedding::{DEFAULT_SUPPORT_CELLS, Embedding, EmbeddingError, EmbeddingKind, MAX_OUTSIDE_CELLS};
pub use exponential_map::{ExponentialMaps, Mapped};
pub use face::{Face, FaceCorners};
pub use hex_mesh::{HEX_FACES, HexMesh, MeshError};
pub use index::{ElementIdx, HexIdx, NodeIdx, TriangleIdx, VertexIdx};
pub use locate::{Location, Locator, locate};
pub use reference_skin::{ContactFrame, ReferenceSkin, SurfacePoint, frame_around};
pub use skin::{Skin, SkinError};
pub use tet_mesh::{TetMesh, TetMeshError, Tets};
pub use volume_mesh::{ElementKind, ElementPoint, VolumeMesh};
