"""Scenes: rods, supports, joints and actions; properties of scenes alone (mechanisms, planes)."""
