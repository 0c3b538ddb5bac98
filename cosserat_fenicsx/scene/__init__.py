"""Scenes: rods, supports, joints and actions, and what follows from these data alone (mechanisms, planes)."""
