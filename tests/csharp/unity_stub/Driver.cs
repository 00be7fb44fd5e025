// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Security.Cryptography;
using System.Text;
using System.Threading;
using SplatBus.Unity;
using UnityEngine;

/// <summary>
/// Runs a SplatBusView on the stub: a command a line, and after each the state in a line of JSON.
/// `set FIELD VALUE`, `camera POSE`, `lens DEGREES NEAR FAR`, `screen WIDTH HEIGHT`, `object ID POSE SCALES`,
/// `shader NAME`, `orthographic`, `linear`, `enable`, `disable`, `step`, `frames COUNT`.
/// </summary>
static class Driver
{
    const int WarmUp = 300, Patience = 20;
    static readonly Transform Place = new Transform();
    static readonly Camera Eye = new Camera();
    static readonly SplatBusView View = new SplatBusView();
    static readonly Action OnEnable = Method("OnEnable"), OnDisable = Method("OnDisable"), LateUpdate = Method("LateUpdate");
    static Material drawn;

    static void Main()
    {
        CultureInfo.DefaultThreadCurrentCulture = CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
        Shader.There = "Hidden/SplatBus/Composite";
        View.Beside.AddRange(new Component[] { Place, Eye });
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] words = line.Split(' ');
            if (words[0] == "frames") Console.WriteLine("{{\"collections\":{0}}}", Frames(int.Parse(words[1])));
            else
            {
                Do(words);
                Console.WriteLine(State());
            }
        }
    }

    static void Do(string[] words)
    {
        if (words[0] == "set") Set(typeof(SplatBusView).GetField(words[1]), words[2]);
        if (words[0] == "camera") Move(Place, words, 1);
        if (words[0] == "lens")
        {
            Eye.fieldOfView = float.Parse(words[1]);
            Eye.nearClipPlane = float.Parse(words[2]);
            Eye.farClipPlane = float.Parse(words[3]);
        }
        if (words[0] == "screen")
        {
            Eye.pixelWidth = int.Parse(words[1]);
            Eye.pixelHeight = int.Parse(words[2]);
            Eye.aspect = (float)Eye.pixelWidth / Eye.pixelHeight;
        }
        if (words[0] == "object")
        {
            var transform = new Transform { lossyScale = new Vector3(float.Parse(words[9]), float.Parse(words[10]), float.Parse(words[11])) };
            Move(transform, words, 2);
            View.objects = new[] { new SplatObject { id = words[1], transform = transform } };
        }
        if (words[0] == "shader") Shader.There = words[1];
        if (words[0] == "orthographic") Eye.orthographic = true;
        if (words[0] == "linear") QualitySettings.activeColorSpace = ColorSpace.Linear;
        if (words[0] == "enable") OnEnable();
        if (words[0] == "disable") OnDisable();
        if (words[0] == "step") Step();
    }

    static void Set(System.Reflection.FieldInfo field, string value)
    {
        field.SetValue(View, Convert.ChangeType(value, field.FieldType, CultureInfo.InvariantCulture));
    }

    static void Move(Transform transform, string[] words, int at)
    {
        var numbers = new float[7];
        for (int i = 0; i < 7; i++) numbers[i] = float.Parse(words[at + i]);
        transform.position = new Vector3(numbers[0], numbers[1], numbers[2]);
        transform.rotation = new Quaternion(numbers[3], numbers[4], numbers[5], numbers[6]);
    }

    static void Step()
    {
        Time.frameCount++;
        LateUpdate();
        drawn = View.Drawn();
        Thread.Sleep(5);
    }

    /// <summary>How often the garbage collector runs while so many images come, each for another pose.</summary>
    static int Frames(int count)
    {
        Look(WarmUp);
        int before = GC.CollectionCount(0);
        Look(count);
        return GC.CollectionCount(0) - before;
    }

    static void Look(int images)
    {
        for (int i = 0; i < images; i++)
        {
            int before = Texture2D.Uploads;
            Place.position = new Vector3(0.1f * i, 0, 0);
            double until = Time.realtimeSinceStartupAsDouble + Patience;
            while (Texture2D.Uploads == before)
            {
                if (Time.realtimeSinceStartupAsDouble > until) throw new TimeoutException("no further image, but " + i);
                Time.frameCount++;
                LateUpdate();
                drawn = View.Drawn();
                Thread.Sleep(0);
            }
        }
    }

    static Action Method(string name) { return (Action)Delegate.CreateDelegate(typeof(Action), View, name); }

    static string State()
    {
        ViewStatus status = View.Status;
        var state = new List<string>
        {
            Member("server", Text(status.Server ?? "")), Member("ipc", Text(status.Ipc.ToString())), Member("message", Text(status.Message.ToString())),
            Member("size", "[" + status.Width + "," + status.Height + "]"), Member("images", status.Images.ToString()),
            Member("problems", "[" + string.Join(",", Array.ConvertAll(status.Problems, Text)) + "]"),
            Member("logged", "[" + string.Join(",", Debug.Logged.ConvertAll(Text)) + "]"),
            Member("view", Matrix(Eye.worldToCameraMatrix)), Member("projection", Matrix(Eye.projectionMatrix)),
        };
        if (drawn != null && !drawn.IsDestroyed)
        {
            foreach (string each in new[] { "_SplatBusLens", "_SplatBusSize", "_SplatBusMeaning", "_SplatBusScene" })
                state.Add(Member(each, "[" + Row(drawn.Vectors[Shader.PropertyToID(each)]) + "]"));
            state.Add(Member("color", Digest("_SplatBusColor")));
            state.Add(Member("depth", Digest("_SplatBusDepth")));
        }
        return "{" + string.Join(",", state) + "}";
    }

    static string Digest(string name)
    {
        var texture = (Texture2D)drawn.Textures[Shader.PropertyToID(name)];
        using (SHA256 digest = SHA256.Create()) return Text(BitConverter.ToString(digest.ComputeHash(texture.Applied)).Replace("-", "").ToLowerInvariant());
    }

    static string Matrix(Matrix4x4 matrix)
    {
        return "[" + string.Join(",", Array.ConvertAll(new[] { matrix.Row0, matrix.Row1, matrix.Row2, matrix.Row3 }, Row)) + "]";
    }

    static string Row(Vector4 row) { return string.Format("{0:r},{1:r},{2:r},{3:r}", row.x, row.y, row.z, row.w); }

    static string Member(string name, string value) { return "\"" + name + "\":" + value; }

    static string Text(string text)
    {
        var written = new StringBuilder("\"");
        foreach (char each in text) written.Append(each < ' ' || each == '"' || each == '\\' ? string.Format("\\u{0:x4}", (int)each) : each.ToString());
        return written.Append('"').ToString();
    }
}
