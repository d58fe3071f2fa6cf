//! Data that clones share until one of them changes it, and that may be made when it is first needed.

use std::{
    fmt,
    ops::{Deref, DerefMut},
    sync::{Arc, OnceLock},
};

use super::once::made_once;

/// A value that clones share. The first change of a clone gives it a value of its own.
#[derive(Clone)]
pub struct Shared<T>(Arc<Value<T>>);

/// A value, or what makes it.
struct Value<T> {
    made: OnceLock<T>,
    make: Option<Box<dyn Fn() -> T + Send + Sync>>,
}

impl<T> Shared<T> {
    /// A value that is made when it is first read or changed. Threads do not wait for one another then, and the first
    /// result is kept: who reads the value in parallel calls [`Shared::make`] before.
    pub(crate) fn lazy(make: impl Fn() -> T + Send + Sync + 'static) -> Self {
        Self(Arc::new(Value { made: OnceLock::new(), make: Some(Box::new(make)) }))
    }

    /// Makes the value if it is not made.
    pub(crate) fn make(&self) {
        let _: &T = self;
    }

    /// Whether the value is made.
    #[doc(hidden)]
    pub fn is_made(&self) -> bool {
        self.0.made.get().is_some()
    }
}

impl<T> From<T> for Shared<T> {
    fn from(value: T) -> Self {
        Self(Arc::new(Value { made: OnceLock::from(value), make: None }))
    }
}

impl<T: Default> Default for Shared<T> {
    fn default() -> Self {
        Self::from(T::default())
    }
}

impl<T> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        made_once(&self.0.made, || self.0.make.as_ref().expect("a value, or what makes it")())
    }
}

impl<T: Clone> DerefMut for Shared<T> {
    fn deref_mut(&mut self) -> &mut T {
        self.make();
        if Arc::get_mut(&mut self.0).is_none() {
            *self = Self::from(T::clone(self));
        }
        Arc::get_mut(&mut self.0).and_then(|value| value.made.get_mut()).expect("a value that nobody else has")
    }
}

impl<T: PartialEq> PartialEq for Shared<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: fmt::Debug> fmt::Debug for Shared<T> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_tuple("Shared").field(&self.0.made.get()).finish()
    }
}

impl<'a, T> IntoIterator for &'a Shared<T>
where
    &'a T: IntoIterator,
{
    type Item = <&'a T as IntoIterator>::Item;
    type IntoIter = <&'a T as IntoIterator>::IntoIter;

    fn into_iter(self) -> Self::IntoIter {
        (**self).into_iter()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn values_are_made_once_and_changed_alone() {
        let n_made = Arc::new(AtomicUsize::new(0));
        let count = n_made.clone();
        let first = Shared::lazy(move || vec![count.fetch_add(1, Ordering::Relaxed)]);
        let mut second = first.clone();
        assert!(!first.is_made() && n_made.load(Ordering::Relaxed) == 0);
        second.push(7);
        assert_eq!((&first[..], &second[..]), (&[0][..], &[0, 7][..]));
        assert_eq!(n_made.load(Ordering::Relaxed), 1);
        second.push(8);
        assert_eq!(*second, [0, 7, 8]);
    }
}
