//! Complex numbers.

use crate::real::Real;
use std::ops::{Add, Mul, Sub};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complex<T>(pub T, pub T);

impl<T: Real> Complex<T> {
    pub const ZERO: Self = Self(T::ZERO, T::ZERO);
    pub const ONE: Self = Self(T::ONE, T::ZERO);

    pub fn conjugate(self) -> Self {
        Self(self.0, -self.1)
    }
    pub fn scaled(self, by: T) -> Self {
        Self(self.0 * by, self.1 * by)
    }
    pub fn square(self) -> T {
        self.0 * self.0 + self.1 * self.1
    }
}
impl<T: Real> Add for Complex<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}
impl<T: Real> Sub for Complex<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}
impl<T: Real> Mul for Complex<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }
}
