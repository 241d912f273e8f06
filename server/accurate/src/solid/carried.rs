//! Stresses of an element as unknowns beside its displacements.

use nalgebra::Matrix3;

/// Mean pressure and second Piola-Kirchhoff stresses of the `Q` Gauss points \[Pa\].
#[derive(Debug, Clone, Copy)]
pub(super) struct Carried<const Q: usize> {
    pub(super) pressure: f64,
    /// Not finite where they have no meaning.
    pub(super) stresses: [Matrix3<f64>; Q],
}

impl<const Q: usize> Carried<Q> {
    /// Numbers of the pressure and the tensors.
    pub(super) const N_VALUES: usize = 1 + Q * 9;

    pub(super) fn append_to(&self, values: &mut Vec<f64>) {
        values.push(self.pressure);
        self.stresses.iter().for_each(|stress| values.extend(stress.iter()));
    }

    /// # Panics
    /// If there are not as many as [`Carried::N_VALUES`].
    pub(super) fn from_values(values: &[f64]) -> Self {
        assert_eq!(values.len(), Self::N_VALUES, "values");
        let stress = |q: usize| Matrix3::from_column_slice(&values[1 + 9 * q..10 + 9 * q]);
        Self { pressure: values[0], stresses: std::array::from_fn(stress) }
    }
}
