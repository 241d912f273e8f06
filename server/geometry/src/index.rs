//! Index types: a node cannot be mistaken for a vertex.

macro_rules! index_type {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The same index, ready for indexing a slice.
            #[inline]
            pub fn index(self) -> usize {
                self.0 as usize
            }

            /// From a position in a slice.
            ///
            /// # Panics
            /// If `index` does not fit 32 bits.
            #[inline]
            pub fn from_index(index: usize) -> Self {
                Self(u32::try_from(index).expect("meshes hold fewer than 2^32 items"))
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

index_type! {
    /// A node of a [`HexMesh`](crate::HexMesh).
    NodeIdx
}
index_type! {
    /// A hexahedron of a [`HexMesh`](crate::HexMesh).
    HexIdx
}
index_type! {
    /// An element of a [`VolumeMesh`](crate::VolumeMesh).
    ElementIdx
}
index_type! {
    /// A vertex of a [`Skin`](crate::Skin), and the row of an [`Embedding`](crate::Embedding) that belongs to it.
    VertexIdx
}
index_type! {
    /// A triangle of a [`Skin`](crate::Skin).
    TriangleIdx
}
