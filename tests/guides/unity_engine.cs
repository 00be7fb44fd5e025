// What the guide for Unity uses of UnityEngine and UnityEditor, and a main loop that drives its adapter.

using System;
using System.Globalization;
using System.Reflection;
using System.Text.RegularExpressions;
using System.Threading;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w)
        {
            this.x = x; this.y = y; this.z = z; this.w = w;
        }
    }

    public class Transform
    {
        public Vector3 position;
        public Quaternion rotation;
        public void SetPositionAndRotation(Vector3 position, Quaternion rotation)
        {
            this.position = position;
            this.rotation = rotation;
        }
    }

    public class Component { public readonly Transform transform = new Transform(); }
    public class Behaviour : Component { public bool enabled; }
    public class MonoBehaviour : Behaviour { }
    public sealed class Camera : Behaviour { }

    public static class Application
    {
        public static bool runInBackground, quit;
        public static void Quit() { quit = true; }
    }

    public static class JsonUtility
    {
        // Enough for flat objects of whole numbers, words, and lists of numbers.
        public static T FromJson<T>(string text)
        {
            var made = Activator.CreateInstance(typeof(T), true);
            foreach (var field in typeof(T).GetFields())
            {
                var found = Regex.Match(text, "\"" + field.Name + "\": *(\\[[^]]*\\]|\"[^\"]*\"|[^,}]*)");
                var value = found.Groups[1].Value;
                if (!found.Success) continue;
                if (field.FieldType == typeof(int)) field.SetValue(made, int.Parse(value));
                if (field.FieldType == typeof(string)) field.SetValue(made, value.Trim('"'));
                if (field.FieldType == typeof(double[]))
                    field.SetValue(made, Array.ConvertAll(value.Trim('[', ']').Split(','), Number));
            }
            return (T)made;
        }

        static double Number(string text)
        {
            return double.Parse(text, CultureInfo.InvariantCulture);
        }
    }
}

namespace UnityEditor
{
    public static class EditorApplication { public static bool isPlaying { get; set; } }
}

namespace UnityEditor.SceneManagement
{
    public static class EditorSceneManager { public static void OpenScene(string path) { } }
}

public static class Engine
{
    const BindingFlags Any = BindingFlags.Instance | BindingFlags.NonPublic | BindingFlags.Public;

    public static void Main()
    {
        var adapter = new SplatBusAdapter
        {
            view = new UnityEngine.Camera(),
            client = new UnityEngine.Behaviour(),
        };
        typeof(SplatBusAdapter).GetMethod("Start", Any).Invoke(adapter, null);
        var update = typeof(SplatBusAdapter).GetMethod("Update", Any);
        while (!UnityEngine.Application.quit)
        {
            update.Invoke(adapter, null);
            Thread.Sleep(5);
        }
        var p = adapter.view.transform.position;
        var q = adapter.view.transform.rotation;
        Thread.CurrentThread.CurrentCulture = CultureInfo.InvariantCulture;
        Console.WriteLine(string.Join(" ", p.x, p.y, p.z, q.x, q.y, q.z, q.w));
        Environment.Exit(UnityEngine.Application.runInBackground ? 0 : 9);
    }
}
