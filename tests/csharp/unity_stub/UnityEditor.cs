// SPDX-License-Identifier: MIT
//
// A stub of UnityEditor: see the head of UnityEngine.cs, which is true of this file, too.
using System;

namespace UnityEditor
{
    public class Editor : UnityEngine.ScriptableObject
    {
        public UnityEngine.Object target { get; set; }
        public virtual void OnInspectorGUI() { }
        public virtual bool RequiresConstantRepaint() { return false; }
        public bool DrawDefaultInspector() { return false; }
    }

    public sealed class CustomEditor : Attribute { public CustomEditor(Type inspectedType) { } }
    public enum MessageType { None, Info, Warning, Error }
    public static class EditorGUILayout { public static void HelpBox(string message, MessageType type) { } }
}
